# SPDX-License-Identifier: Apache-2.0
"""No key makes the Go2 fall: random ones, and from each state into each other."""

from collections.abc import Iterator
import importlib
from pathlib import Path
from typing import Any

import pytest
from quadruped_sim.keys import StateName
from teleop_keyboard.key_script import parse_key_script

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture(scope='module')
def bench() -> Iterator[Any]:
    """Return a function: a module of the benchmark by its name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield importlib.import_module


def test_a_monkey_presses_every_kind_of_key(bench: Any) -> None:
    keys = {
        press.key
        for seed in range(20)
        for press in parse_key_script(bench('random_keys').monkey_keys(60.0, seed), 'keys')
    }
    assert set('1234567890vwasdjliknN') | {' '} <= keys


@pytest.mark.parametrize(('gait', 'world'), [('trot', 'flat'), ('walk', 'boxes:0.05')])
def test_random_keys_make_nothing_fall(bench: Any, gait: str, world: str) -> None:
    tried = bench('legs_states').monkey('', [3000], 30.0, world=world, gait=gait)
    assert bench('trials').simulate(tried.runs[0]).report['falls'] == 0


def test_a_tour_goes_from_a_state_into_each_other(bench: Any) -> None:
    for source in StateName:
        tour = bench('state_pairs').tour(source, 'at rest', 1)
        assert set(tour.times) == set(StateName) - {source}
        wanted, begun = list(tour.times.items())[-1]
        assert tour.pair_at(begun) == f'{source.value} to {wanted.value}'


def test_a_push_in_the_swing_test_makes_nothing_that_follows_fall(bench: Any) -> None:
    pairs = bench('state_pairs')
    tour = pairs.tour(StateName.SWING_TEST, 'pushed by 15 N s', 3001)
    report = bench('trials').simulate(tour.run).report
    assert report['fell_at'] is None or tour.pair_at(report['fell_at']).endswith('to passive')
