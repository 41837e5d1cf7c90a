# SPDX-License-Identifier: Apache-2.0
"""Runs give what they gave when their outcome was written down: tests/golden_runs.py says how."""

import json
from pathlib import Path
import subprocess
import sys
from typing import Any

from cases import for_all
import golden_runs
import pytest

pytestmark = [pytest.mark.long, pytest.mark.slow]

TESTS = Path(__file__).resolve().parents[1]
WRITTEN = json.loads((TESTS / 'golden' / 'runs.json').read_text())


@pytest.fixture(scope='module')
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What comes of all runs now, in a process of their own."""
    file = tmp_path_factory.mktemp('golden') / 'runs.json'
    words = [sys.executable, str(TESTS / 'golden_runs.py'), str(file)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(file.read_text())


def test_the_same_runs_are_written_down() -> None:
    assert list(WRITTEN['runs']) == list(golden_runs.RUNS)


def test_what_is_knocked_over_has_fallen_and_gets_up() -> None:
    knocked = WRITTEN['runs']['knocked over']
    assert knocked['falls'] == [1]
    assert 'get up' in knocked['states']['go2']


def test_over_boxes_of_5_cm_it_walks_at_half_a_metre_a_second_for_three() -> None:
    walked = WRITTEN['runs']['boxes']
    assert walked['falls'] == [0]
    assert walked['ends']['go2'][0] > 1.1


@for_all('name', golden_runs.RUNS)
def test_a_run_gives_what_is_written_down(name: str, outcome: Any) -> None:
    written, now = WRITTEN['runs'][name], outcome['runs'][name]
    if outcome['arithmetic'] == WRITTEN['arithmetic']:
        assert now == written
    # Another machine rounds otherwise: the walk is the same, its last bits are not.
    assert (now['states'], now['falls']) == (written['states'], written['falls'])
    for robot, end in written['ends'].items():
        assert now['ends'][robot] == pytest.approx(end, abs=golden_runs.NEAR)
    for topic, (kind, count, *_) in written.get('topics', {}).items():
        assert now['topics'][topic][:2] == [kind, count]
