# SPDX-License-Identifier: Apache-2.0
"""Rates on an idle core: which slices of a measurement count."""

import json
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(BENCHMARKS))
    from idle_core import IdleCore, Rates


def core_with(loops, monkeypatch):
    """Return a core whose fixed loop takes these times [s]; the shortest is known before."""
    core, coming = IdleCore(), iter(loops)
    core._shortest = min(loops)
    monkeypatch.setattr(core, '_loop', lambda: next(coming))
    return core


def test_slices_count_where_the_loop_was_short_before_and_after(monkeypatch):
    core = core_with((1.0, 1.0, 1.0, 1.2, 1.2, 1.0, 1.04, 1.04), monkeypatch)
    measured = iter((30.0, 10.0, 11.0, 28.0))
    rates = core.rates(lambda: next(measured), 4)
    assert rates == Rates(idle=29.0, overall=19.5, idle_slices=2, slices=4)
    assert rates.reaches(29.0) and not rates.reaches(29.1)
    assert rates.told(1) == '29.0 in the 2 of 4 slices in which it was idle, 19.5 in all'


def test_a_core_that_was_never_idle_reaches_nothing_and_is_plain_json(monkeypatch):
    rates = core_with((1.0, 2.0, 2.0, 1.0), monkeypatch).rates(lambda: 30.0, 2)
    assert not rates.reaches(1.0)
    assert rates.told(0) == 'never idle in 2 slices, 30 in all'
    assert json.loads(json.dumps(rates._asdict(), allow_nan=False))['idle'] is None
