# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a program is still loading: it ends without a word."""

import signal
import subprocess
import sys

from executables import SCRIPTS
import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# A program as its script starts it, with a Ctrl-C at the moment when a module is looked for.
PROGRAM = """
import importlib, os, signal, sys
class Interrupt:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == moment:
            os.kill(os.getpid(), signal.SIGINT)
module, moment = sys.argv.pop(1), sys.argv.pop(1)
sys.meta_path.insert(0, Interrupt)
sys.argv[0] = sys.argv[1]
del sys.argv[1]
name, _, function = module.partition(':')
sys.exit(getattr(importlib.import_module(name), function)())
"""


def run(script: str, moment: str, *arguments: str) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [sys.executable, '-c', PROGRAM, SCRIPTS[script], moment, f'/usr/bin/{script}', *arguments],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE,
    )


@pytest.mark.parametrize('script', sorted(SCRIPTS))
def test_ctrl_c_ends_each_program_silently_from_its_first_import_on(script: str) -> None:
    done = run(script, SCRIPTS[script].partition(':')[0])
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, '', '')


@pytest.mark.parametrize(
    ('script', 'moment', 'arguments'),
    [
        ('teleop', 'rclpy', ()),
        ('key_publisher', 'std_msgs', ()),
        ('wasd', 'argparse', ('mbot', '--duration', '1')),
        ('wasd', 'rclpy', ('mbot', '--duration', '1')),
    ],
)
def test_ctrl_c_ends_it_silently_while_libraries_are_loaded(
    script: str, moment: str, arguments: tuple[str, ...]
) -> None:
    done = run(script, moment, *arguments)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, '', '')


def test_an_import_into_another_program_changes_nothing_about_ctrl_c() -> None:
    code = (
        'import signal, wasd_bringup.cli, teleop_keyboard.terminal\n'
        'assert signal.getsignal(signal.SIGINT) is signal.default_int_handler'
    )
    subprocess.run([sys.executable, '-c', code], check=True)
