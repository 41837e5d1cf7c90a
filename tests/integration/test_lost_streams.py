# SPDX-License-Identifier: Apache-2.0
"""A run whose standard streams are closed, full or not read drives on, and ends as usual."""

import subprocess
import sys
from typing import Any

import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

RUN = ('mbot', '--speed', '0', '--duration', '2', '--viewer', 'none')


@pytest.mark.parametrize(
    'redirection',
    ['2>&-', '<&- >&- 2>&-', '>/dev/full', '>/dev/full 2>/dev/full', '| true'],
)
def test_a_run_does_without(environment: dict[str, str], tmp_path: Any, redirection: str) -> None:
    done = subprocess.run(
        ['/bin/bash', '-o', 'pipefail', '-c', f'"$0" -m wasd_bringup.cli "$@" {redirection}',
         sys.executable, *RUN, '--report', 'report.json'],
        env=environment, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=PATIENCE,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
    assert (tmp_path / 'report.json').exists()
