# SPDX-License-Identifier: Apache-2.0
"""What numba compiled is kept for as long as no file of its package changes."""

import os
import subprocess
import sys

from wasd_core.jit import forget_stale

KERNELS = """
from wasd_core.jit import jit
from kernels.size import SIZE

@jit
def size():
    return SIZE
"""
USE = 'from kernels.size import size; print(size(), *size.stats.cache_hits.values())'


def test_what_was_compiled_of_other_files_is_forgotten(tmp_path):
    """Functions of other files are compiled into a cached one, and classes move."""
    package = tmp_path / 'legs'
    caches = [package / '__pycache__', package / 'gait/__pycache__']
    for cache in caches:
        cache.mkdir(parents=True)
    called, kept = package / 'algebra.py', caches[1] / 'swing.step-7.py311.nbi'
    called.write_text('one = 1')

    def is_kept() -> bool:
        forget_stale(package)
        return kept.exists()

    kept.touch()
    assert not is_kept()  # of which files it was made nobody knows
    kept.touch()
    assert is_kept()
    called.write_text('one = 2.0')
    assert not is_kept()
    kept.touch()
    (package / 'gait/moved.py').touch()
    assert not is_kept()
    # An editor's lock is no module, and goes nowhere.
    (package / '.#algebra.py').symlink_to('somebody@host.123')
    kept.touch()
    assert is_kept()


def test_a_kernel_knows_the_other_files_of_its_package_under_any_name_of_it(tmp_path):
    """As it is in a colcon workspace of links."""
    package = tmp_path / 'kernels'
    package.mkdir()
    package.joinpath('__init__.py').touch()
    package.joinpath('numbers.py').write_text('SIZE = 1')
    package.joinpath('size.py').write_text(KERNELS.replace('kernels.size', 'kernels.numbers'))
    (tmp_path / 'install').mkdir()
    (tmp_path / 'install/kernels').symlink_to(package)

    def use(folder: str) -> str:
        path = os.pathsep.join(sys.path)
        return subprocess.run(
            [sys.executable, '-c', USE],
            cwd=tmp_path / folder,
            env={**os.environ, 'PYTHONPATH': path},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()

    assert use('.') == '1'
    assert use('install') == '1 1'
    assert use('.') == '1 1'
    package.joinpath('numbers.py').write_text('SIZE = 22')
    assert use('.') == '22'
