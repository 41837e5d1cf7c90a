# SPDX-License-Identifier: Apache-2.0
"""`wasd test`: the test-suite of the clone that this was installed from."""

from collections.abc import Sequence
import os
from pathlib import Path
import subprocess
import sys

from wasd_bringup.errors import UsageError


def test_command(arguments: Sequence[str]) -> int:
    """
    Run pytest on the clone's tests; return its exit status.

    Raises:
        UsageError: this is not installed from a clone.
    """
    root = Path(__file__).resolve().parents[2]
    if not (root / 'tests').is_dir():
        raise UsageError(f'the tests come with a clone of the repository; none at {root}')
    environment = {**os.environ, 'PYTHONDONTWRITEBYTECODE': '1'}
    command = [sys.executable, '-m', 'pytest', *arguments]
    return subprocess.run(command, cwd=root, env=environment, check=False).returncode
