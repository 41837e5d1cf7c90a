# SPDX-License-Identifier: Apache-2.0
"""What tests start by a fork is as what Python starts, see tests/warm_starts.py."""

import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import programs
import pytest
import warm_starts

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def usual_environment(monkeypatch: Any) -> None:
    """Have nothing in the environment that another test has left there."""
    for name in warm_starts.differing(os.environ):
        if name in warm_starts.USUAL:
            monkeypatch.setenv(name, warm_starts.USUAL[name])
        else:
            monkeypatch.delenv(name)


def look(session: Any) -> dict[str, Any]:
    """Return what the system knows of a session's process, but for its number."""
    pid, terminal = session.process.pid, os.ttyname(session.slave)
    folder = Path(f'/proc/{pid}')
    stat = folder.joinpath('stat').read_text().rpartition(')')[2].split()
    status = folder.joinpath('status').read_text().splitlines()
    words = folder.joinpath('cmdline').read_bytes().rstrip(b'\0').split(b'\0')
    return {
        'is our child': int(stat[1]) == os.getpid(),
        'leads': [int(one) == pid for one in stat[2:4]],
        'terminal': int(stat[4]) == os.stat(terminal).st_rdev,
        'words': words,
        'folder': os.readlink(folder / 'cwd'),
        'streams': [os.readlink(folder / f'fd/{one}') == terminal for one in range(3)],
        'signals': [line for line in status if line.startswith('Sig') and 'SigQ' not in line],
    }


def test_for_the_system_a_forked_session_is_as_one_that_python_starts(
    start: Any, monkeypatch: Any
) -> None:
    seen = []
    for is_warm in (True, False):
        if not is_warm:
            monkeypatch.setattr(warm_starts, 'as_warm', lambda *_: None)
        session = start()
        assert isinstance(session.process, warm_starts.Started) == is_warm
        session.wait_for('Ctrl-C quit')
        seen.append(look(session))
        session.type('\x03')
        seen[-1] |= {'status': session.end()}
    assert seen[0] == seen[1]
    assert seen[0]['is our child']
    assert seen[0]['status'] == 0


def test_a_signal_is_the_end_of_a_forked_program_and_its_status(wasd: Any) -> None:
    process = wasd.start('mbot', '--viewer', 'none', '--no-ros')
    assert isinstance(process, warm_starts.Started)
    assert process.poll() is None
    process.kill()
    assert process.wait() == -9


@pytest.mark.parametrize(
    ('words', 'own'),
    [
        (('-m', 'wasd_bringup.cli', 'demo'), {}),
        (('-m', 'wasd_bringup.cli', 'mbot'), {'PYTHONHASHSEED': '1'}),
        (('-m', 'wasd_bringup.cli', 'mbot'), {'MUJOCO_GL': 'off'}),
        (('-P', '-m', 'wasd_bringup.cli', 'mbot'), {}),
        (('-c', 'pass'), {}),
    ],
)
def test_what_loads_otherwise_is_started_by_python(words: Any, own: dict[str, str]) -> None:
    process = programs.start(
        [sys.executable, *words, '--help'],
        env=os.environ | own,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    process.wait()
    assert not isinstance(process, warm_starts.Started)
