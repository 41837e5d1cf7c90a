# SPDX-License-Identifier: Apache-2.0
"""A colcon workspace of the checkout, and programs started from it as from a sourced shell."""

from collections.abc import Callable, Iterator
import functools
import os
from pathlib import Path
import pty
import shutil
import signal
import subprocess
import sys
import sysconfig
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
COLCON = shutil.which('colcon') or shutil.which('colcon', path=sysconfig.get_path('scripts'))
SOURCED = '. "$1/setup.bash" && exec env -0'


class Program:
    """A program of a workspace, on a pseudo-terminal as its standard input."""

    def __init__(self, process: 'subprocess.Popen[bytes]', terminal: int, said: Path) -> None:
        self.process = process
        self._terminal = terminal
        self._said = said

    @property
    def said(self) -> str:
        """What it has written to standard output and error."""
        return self._said.read_text()

    def interrupt(self) -> int:
        """Press Ctrl-C, so to speak; return its exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60.0)

    def close(self) -> None:
        """End it if it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._terminal)


class Workspace:
    """A workspace, built; what is started in it has sourced it, and finds nothing else of ours."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.install = folder / 'install'
        self._folder = folder
        self._environment = {
            name: value for name, value in os.environ.items() if name != 'PYTHONPATH'
        }
        self._environment |= {
            'AMENT_PREFIX_PATH': sys.prefix,
            'PYTHONNOUSERSITE': '1',
            'ROS_LOG_DIR': str(folder / 'ros_log'),
        }
        command = [str(COLCON), '--log-base', 'log', 'build', *options]
        command += [
            '--base-paths',
            str(ROOT),
            '--build-base',
            'build',
            '--install-base',
            'install',
        ]
        done = subprocess.run(
            command, cwd=folder, env=self._environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        # Once: bash takes longer than many a command that is run.
        done = subprocess.run(
            ['bash', '-c', SOURCED, 'bash', str(self.install)],
            env=self._environment,
            capture_output=True,
            text=True,
            check=True,
        )
        self._environment = dict(line.split('=', 1) for line in done.stdout.split('\0') if line)

    def run(self, *command: str) -> 'subprocess.CompletedProcess[str]':
        """Run a command to its end."""
        return subprocess.run(
            command, cwd=self._folder, env=self._environment, capture_output=True, text=True
        )

    def start(self, *command: str, **extra: str) -> Program:
        """Start a command."""
        ours, theirs = pty.openpty()
        said = self._folder / f'said_by_{Path(command[0]).name}'
        with said.open('wb') as output:
            process = subprocess.Popen(
                command,
                cwd=self._folder,
                env={**self._environment, **extra},
                stdin=theirs,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        os.close(theirs)
        return Program(process, ours, said)


@pytest.fixture(scope='session')
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Workspace]:
    """Return `build(*options)`, which builds a workspace once for each set of options."""

    @functools.cache
    def build_workspace(*options: str) -> Workspace:
        if COLCON is None:
            pytest.skip("no colcon: pip install -e '.[colcon]'")
        return Workspace(tmp_path_factory.mktemp('workspace'), *options)

    return build_workspace


COPIED = pytest.param(
    (),
    marks=pytest.mark.skipif(
        'WASD_TEST_WHEELS' not in os.environ, reason='WASD_TEST_WHEELS=1 asks'
    ),
    id='copied',
)


@pytest.fixture(params=[COPIED, pytest.param(('--symlink-install',), id='symlinks')])
def workspace(request: Any, build: Callable[..., Workspace]) -> Workspace:
    """Return a workspace that colcon has built, in each of its two ways."""
    return build(*request.param)


@pytest.fixture
def start(workspace: Workspace) -> Iterator[Callable[..., Program]]:
    """Return `start(package, executable, *arguments)`, which starts it from `lib/<package>`."""
    programs: list[Program] = []

    def start_program(package: str, executable: str, *arguments: str) -> Program:
        path = workspace.install / package / 'lib' / package / executable
        extra = {
            name: os.environ[name] for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE')
        }
        programs.append(workspace.start(str(path), *arguments, **extra))
        return programs[-1]

    yield start_program
    for program in programs:
        program.close()
