# SPDX-License-Identifier: Apache-2.0
"""What numba compiled is kept for as long as no file of its package, or of wasd_core, changes."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest
import starting

import wasd_core

KERNELS = """
from wasd_core.jit import jit
from kernels.numbers import SIZE

@jit
def size():
    return SIZE
"""
USE = """
from kernels.size import size
print('ready', flush=True)
input()
print(size(), *size.stats.cache_hits.values())
"""


class Kernels:
    """A package with one kernel, which a process of its own calls."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.package = folder, folder / 'kernels'
        self.package.mkdir()
        self.package.joinpath('__init__.py').touch()
        self.set_size(1)
        self.package.joinpath('size.py').write_text(KERNELS)
        folder.joinpath('use.py').write_text(USE)
        self.environment = dict(os.environ)

    def set_size(self, size: int) -> None:
        """Change a file that the kernel is compiled of, beside its own."""
        self.package.joinpath('numbers.py').write_text(f'SIZE = {size}')

    def start(self, place: str = '.') -> 'subprocess.Popen[str]':
        """Start a process that has loaded the kernel, from a folder, and waits."""
        process = starting.Popen(
            [sys.executable, '-m', 'use'],
            cwd=self.folder / place,
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        return process

    def use(self, place: str = '.') -> str:
        """Return the kernel's value, and 1 if it was not compiled."""
        return call(self.start(place))

    def kept(self) -> list[str]:
        """Return what is kept for the kernel, in any folder."""
        return sorted(path.name for path in self.folder.rglob('size*.nb[ci]'))


def call(process: 'subprocess.Popen[str]') -> str:
    """Have a process call the kernel, and return what it says."""
    said, _ = process.communicate('\n', timeout=60)
    assert process.returncode == 0
    return said.strip()


@pytest.fixture
def kernels(tmp_path):
    """A package with a kernel that was never compiled."""
    return Kernels(tmp_path)


def test_a_kernel_knows_the_other_files_of_its_package_under_any_name_of_it(kernels):
    """As it is in a colcon workspace of links."""
    (kernels.folder / 'install').mkdir()
    (kernels.folder / 'install/kernels').symlink_to(kernels.package)
    (kernels.folder / 'install/use.py').symlink_to(kernels.folder / 'use.py')
    assert kernels.use() == '1'
    assert kernels.use('install') == '1 1'
    assert kernels.use() == '1 1'
    # An editor's lock is no module, and goes nowhere; another program's files are none of ours.
    (kernels.package / '.#numbers.py').symlink_to('somebody@host.123')
    (kernels.package / '__pycache__/theirs.step-7.py311.nbi').touch()
    assert kernels.use() == '1 1'
    kernels.set_size(22)
    assert kernels.use() == '22'
    assert len(kernels.kept()) == 2  # an index and one function: what is stale is removed
    (kernels.package / 'gait').mkdir()
    (kernels.package / 'gait/moved.py').touch()
    assert kernels.use() == '22'
    assert (kernels.package / '__pycache__/theirs.step-7.py311.nbi').exists()


@pytest.mark.parametrize('place', ['told', 'home'])
def test_a_kernel_knows_them_where_it_is_kept_elsewhere(place, kernels):
    """As where the package cannot be written."""
    kernels.environment.pop('NUMBA_CACHE_DIR', None)
    kernels.environment.pop('XDG_CACHE_HOME', None)
    if place == 'told':
        kernels.environment['NUMBA_CACHE_DIR'] = str(kernels.folder / 'cache')
    else:
        kernels.environment['HOME'] = str(kernels.folder / 'home')
        (kernels.package / '__pycache__').touch()  # no folder can be made here, not even by root
    assert kernels.use() == '1'
    assert len(kernels.kept()) == 2
    kernels.set_size(22)
    assert kernels.use() == '22'
    assert len(kernels.kept()) == 2


def test_a_kernel_knows_the_files_of_wasd_core(kernels):
    ours = kernels.folder / 'wasd_core'
    ignored = shutil.ignore_patterns('__pycache__')
    shutil.copytree(Path(wasd_core.__file__).parent, ours, ignore=ignored)
    (ours / 'weight.py').write_text('GRAVITY = 9.81')
    kernels.environment['PYTHONPATH'] = str(kernels.folder)  # started from the beginning
    (kernels.package / 'numbers.py').write_text('from wasd_core.weight import GRAVITY as SIZE')
    assert kernels.use() == '9.81'
    (ours / 'weight.py').write_text('GRAVITY = 3.7')
    assert kernels.use() == '3.7'


def test_what_an_older_process_compiles_after_a_change_is_not_used(kernels):
    older = kernels.start()
    kernels.set_size(22)
    assert kernels.use() == '22'
    assert call(older) == '1'
    assert kernels.use() == '22 1'
