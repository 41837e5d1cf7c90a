# SPDX-License-Identifier: Apache-2.0
"""Whole runs of the command, each in a process and a ROS domain of its own."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import random
import subprocess
import sys
from typing import Any

import pytest

WASD = (sys.executable, '-m', 'wasd_bringup.cli')


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment that no other ROS program on this machine shares."""
    return {
        **os.environ,
        'ROS_DOMAIN_ID': str(random.SystemRandom().randint(1, 100)),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(tmp_path / 'log'),
    }


@pytest.fixture
def wasd(
    environment: dict[str, str], tmp_path: Path
) -> Callable[..., 'subprocess.CompletedProcess[str]']:
    """Return a function that runs `wasd` with arguments, without a terminal, and captures it."""

    def run(*arguments: str, **options: Any) -> 'subprocess.CompletedProcess[str]':
        return subprocess.run(
            [*WASD, *arguments],
            env=environment,
            cwd=tmp_path,
            text=True,
            capture_output=True,
            start_new_session=True,
            timeout=options.pop('timeout', 60),
            check=False,
            **{'stdin': subprocess.DEVNULL, **options},
        )

    return run


@pytest.fixture
def report_of(wasd: Callable[..., Any], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Return a function that runs `wasd mbot` on a script and returns its report."""

    def run(
        *arguments: str, play: str | None = None, twist: str | None = None, speed: str = '0'
    ) -> dict[str, Any]:
        words = ['mbot', '--speed', speed, '--report', 'report.json', *arguments]
        for option, text in (('--play', play), ('--twist', twist)):
            if text is not None:
                (tmp_path / f'{option[2:]}.txt').write_text(text)
                words += [option, f'{option[2:]}.txt']
        done = wasd(*words)
        assert done.returncode == 0, done.stderr
        report: dict[str, Any] = json.loads((tmp_path / 'report.json').read_text())
        return report

    return run
