# SPDX-License-Identifier: Apache-2.0
"""`wasd test`, `wasd lint` and `wasd bench`: what needs the clone that this was installed from."""

from collections.abc import Sequence
import importlib.util
from pathlib import Path
import signal
import subprocess
import sys

from wasd_bringup.errors import UsageError

# What a quick test does without; tests/marking.py sets the first four by what a test uses.
SLOW_MARKS = ('process', 'ros', 'run', 'browser', 'slow')
# Tests wait more than they compute; a module's runs are shared by its tests.
WORKERS = ('-n', 'auto', '--maxprocesses', '4', '--dist', 'loadfile')
LINTERS = (('ruff', 'check', '.'), ('ruff', 'format', '--check', '.'), ('mypy',))


def run_tests(arguments: Sequence[str]) -> int:
    """
    Run pytest on the clone's tests; return its exit status.

    `--quick` runs the tests that need no process, no ROS and no browser, in one process; other
    arguments go to pytest.

    Raises:
        UsageError: this is not installed from a clone.
    """
    words = list(arguments)
    if '--quick' in words:
        words.remove('--quick')
        words = ['-m', ' and '.join(f'not {mark}' for mark in SLOW_MARKS), '-q', *words]
    else:
        words = [*WORKERS, *words]
    return _run('tests', 'pytest', *words)


def run_linters(arguments: Sequence[str]) -> int:
    """
    Run the linters on the clone, all of them; return 0 if all are content.

    Raises:
        UsageError: this is not installed from a clone, or without its linters.
    """
    if arguments:
        raise UsageError(f'lint takes no arguments, got {" ".join(arguments)}')
    missing = [words[0] for words in LINTERS if importlib.util.find_spec(words[0]) is None]
    if missing:
        raise UsageError(
            f'{missing[0]} is not installed: {sys.executable} -m pip install -e '
            f"'{_clone('tests')}[lint]'"
        )
    return max(_run('tests', *words) for words in LINTERS)


def run_benchmark(arguments: Sequence[str]) -> int:
    """
    Run the clone's benchmark; return its exit status: 1 when a bound is missed.

    Raises:
        UsageError: this is not installed from a clone.
    """
    script = _clone('benchmarks') / 'benchmarks' / 'run.py'
    return _start([sys.executable, str(script), *arguments])


def _run(folder: str, module: str, *arguments: str) -> int:
    return _start([sys.executable, '-m', module, *arguments], cwd=_clone(folder))


def _start(words: Sequence[str], cwd: Path | None = None) -> int:
    # Ctrl-C is for both: whoever is started has the last word.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    return subprocess.run(words, cwd=cwd).returncode


def _clone(folder: str) -> Path:
    root = Path(__file__).resolve().parents[2]
    if not (root / folder).is_dir():
        raise UsageError(f'{folder}/ comes with a clone of the repository; none at {root}')
    return root
