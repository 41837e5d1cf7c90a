# SPDX-License-Identifier: Apache-2.0
"""What tests fork from a process that is loaded is as what is started from the beginning."""

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import pytest
import starting

WASD = [sys.executable, '-m', 'wasd_bringup.cli']


@pytest.fixture(params=['forked', 'executed'])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Have programs started in one way, then in the other."""
    monkeypatch.delenv('WASD_TEST_EXEC', raising=False)
    if request.param == 'executed':
        monkeypatch.setenv('WASD_TEST_EXEC', '1')
    return str(request.param)


@pytest.fixture
def forks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the numbers of the processes that are forked from now on."""
    seen: list[int] = []
    fork = starting._fork

    def noted(*arguments: Any) -> int:
        seen.append(fork(*arguments))
        return seen[-1]

    monkeypatch.setattr(starting, '_fork', noted)
    return seen


@pytest.mark.parametrize(
    ('words', 'status', 'said'),
    [
        (['--version'], 0, 'wasd '),
        (['mbot', '--speed', '-1'], 2, "error: --speed: got '-1'"),
        (['mbot', '--duration', '1', '--preset', 'piano'], 2, "error: unknown preset 'piano'"),
        (
            ['go2', '--duration', '1', '--preset', 'untree'],
            2,
            "error: unknown preset 'untree',",
        ),
        (['keys', 'untree'], 2, "error: unknown preset 'untree', did you mean unitree?"),
        (
            ['mbot', '--duration', '0.1', '--speed', '0', '--report', 'r.json'],
            0,
            '0.1 s simulated',
        ),
    ],
    ids=lambda value: ' '.join(value) if isinstance(value, list) else '',
)
def test_it_says_the_same_and_ends_with_the_same_status(
    way: str, forks: list[int], tmp_path: Path, words: list[str], status: int, said: str
) -> None:
    done = starting.run([*WASD, *words], 60.0, text=True, cwd=tmp_path, stdin=subprocess.DEVNULL)
    assert done.returncode == status
    assert (done.stderr if status else done.stdout).startswith(said), done
    assert (tmp_path / 'r.json').is_file() == ('--report' in words)
    assert len(forks) == (way == 'forked')


def test_it_is_our_child_in_a_session_of_its_own_and_a_signal_ends_it(
    way: str, run_with_page: Callable[..., Any]
) -> None:
    process = run_with_page('mbot').process
    parent = Path(f'/proc/{process.pid}/stat').read_text().rsplit(')', 1)[1].split()[1]
    assert int(parent) == os.getpid()
    assert os.getsid(process.pid) == process.pid
    process.terminate()
    assert process.wait(20.0) == 128 + 15


def test_another_environment_for_python_is_a_start_from_the_beginning(forks: list[int]) -> None:
    environment = {**os.environ, 'PYTHONHASHSEED': '1'}
    assert starting.run([*WASD, '--version'], 60.0, env=environment).returncode == 0
    assert forks == []
