# SPDX-License-Identifier: Apache-2.0
"""`wasd test` and `wasd bench`: what needs the clone that this was installed from."""

from collections.abc import Sequence
from pathlib import Path
import subprocess
import sys

from wasd_bringup.errors import UsageError


def run_tests(arguments: Sequence[str]) -> int:
    """
    Run pytest on the clone's tests; return its exit status.

    Raises:
        UsageError: this is not installed from a clone.
    """
    root = _clone('tests')
    return subprocess.run([sys.executable, '-m', 'pytest', *arguments], cwd=root).returncode


def run_benchmark(arguments: Sequence[str]) -> int:
    """
    Run the clone's benchmark; return its exit status: 1 when a bound is missed.

    Raises:
        UsageError: this is not installed from a clone.
    """
    script = _clone('benchmarks') / 'benchmarks' / 'run.py'
    return subprocess.run([sys.executable, str(script), *arguments]).returncode


def _clone(folder: str) -> Path:
    root = Path(__file__).resolve().parents[2]
    if not (root / folder).is_dir():
        raise UsageError(f'{folder}/ comes with a clone of the repository; none at {root}')
    return root
