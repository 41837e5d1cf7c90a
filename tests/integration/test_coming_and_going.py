# SPDX-License-Identifier: Apache-2.0
"""Starts, ends and staying leave nothing: `cycles` and `soak` of the benchmark, in short."""

from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture
def benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the benchmark's modules to import."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def test_programs_started_and_stopped_leave_nothing(benchmarks: Any) -> None:
    import cycles

    # One of each kind; test_no_litter.py has one more, and what it logs.
    programs = dict.fromkeys(('teleop', 'simulator', 'wasd go2'), 1)
    rows = cycles.measure(True, lambda text: None, programs, 8, workers=1)
    assert [(row.what, row.measured) for row in rows if not row.passed] == []
    assert len(rows) == len(programs) + 9


def test_both_robots_under_random_keys_hold_what_they_hold(
    benchmarks: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    import soak

    # Memory is constant to a thousandth after 5 s: a leak shows sooner by a tighter bound.
    monkeypatch.setattr(soak, 'QUICK', 9.0)
    monkeypatch.setattr(soak, 'ENDING', 1.0)
    monkeypatch.setattr(soak, 'QUICK_SETTLED', 5.0)
    monkeypatch.setattr(soak, 'FLAT', 0.01)
    monkeypatch.setattr(soak, 'LOOK_PERIOD', 0.05)
    (row,) = soak.measure(True, lambda text: None)
    assert row.passed, row.measured
