# SPDX-License-Identifier: Apache-2.0
"""Who starts a program in a stranger's folder runs nothing that lies there, nor reads it."""

import os
from pathlib import Path
import subprocess
import sys

from folder_watch import opened_in
import pytest

pytestmark = pytest.mark.slow

NOBODY = 65534
RUN = ('mbot', '--duration', '0.1', '--speed', '0', '--viewer', 'none')
BIN = Path(sys.prefix) / 'bin'
# Names that our programs import, or might; `signal` and `enum` before any package is loaded.
MODULES = ('numba', 'yaml', 'sitecustomize', 'usercustomize', 'signal', 'enum', 'mujoco', 'numpy')
SCRIPT = 'import wasd; wasd.Go2().run(0.01)'
STARTS = {
    'the command': [BIN / 'wasd', *RUN],
    'its module': [sys.executable, '-m', 'wasd_bringup.cli', *RUN],
    'an executable': [BIN / 'describe', 'info', 'mbot'],
    'the compiler': [sys.executable, '-m', 'quadruped_sim'],
    'a script of a line': [sys.executable, '-c', SCRIPT],
}


@pytest.fixture
def trap(tmp_path):
    """A folder in which another user has laid what programs look for where they are started."""
    folder = tmp_path / 'trap'
    folder.mkdir()
    said = 'import os; os.write(2, b"caught by " + __name__.encode() + bytes(1))\n'
    for name in MODULES:
        (folder / f'{name}.py').write_text(said)
    (folder / '.numba_config.yaml').write_text(f'cache_dir: {folder / "cache"}\n')
    (folder / '.env').write_text(f'NUMBA_CACHE_DIR={folder / "cache"}\n')
    (folder / 'DEFAULT_FASTRTPS_PROFILES.xml').write_text('<profiles/>')
    (folder / 'cache').mkdir()
    folder.chmod(0o777)
    if os.geteuid() == 0:
        for path in (folder, *folder.iterdir()):
            os.chown(path, NOBODY, NOBODY)
    return folder


@pytest.mark.parametrize('start', STARTS)
def test_nothing_in_a_strangers_folder_is_opened(start, trap):
    with opened_in(trap) as names:
        done = subprocess.run(
            list(map(str, STARTS[start])),
            cwd=trap,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=300,
        )
    assert (done.returncode, names) == (0, set()), done.stderr
    assert 'caught' not in done.stderr
    assert list((trap / 'cache').iterdir()) == []


def test_a_script_of_a_line_hears_why_it_finds_no_module_there(trap):
    done = subprocess.run(
        [sys.executable, '-c', 'import wasd, enum, yaml'], cwd=trap, capture_output=True, text=True
    )
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
    assert 'ignores modules of this folder' in done.stderr


def test_a_script_of_a_line_finds_modules_in_its_own_folder(tmp_path):
    (tmp_path / 'helper.py').write_text('print("helped")')
    done = subprocess.run(
        [sys.executable, '-c', 'import wasd, helper'], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, 'helped\n', '')


def test_a_numba_that_another_has_imported_forgets_the_folders_settings(tmp_path):
    (tmp_path / '.numba_config.yaml').write_text('cache_dir: /somewhere\n')
    look = 'print(numba.config.CACHE_DIR or None)'
    done = subprocess.run(
        [sys.executable, '-c', f'import numba; {look}; import wasd_core.jit; {look}'],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if 'NUMBA' not in name},
        capture_output=True,
        text=True,
    )
    assert (done.stdout, done.stderr) == ('/somewhere\nNone\n', '')
