# SPDX-License-Identifier: Apache-2.0
"""No key makes the Go2 fall: random ones, and from each state into each other."""

import json
from typing import Any

import pytest
from quadruped_sim.keys import StateName
from teleop_keyboard.key_script import parse_key_script

pytestmark = pytest.mark.slow


def test_a_monkey_presses_every_kind_of_key(bench: Any) -> None:
    keys = {
        press.key
        for seed in range(20)
        for press in parse_key_script(bench('random_keys').monkey_keys(60.0, seed), 'keys')
    }
    assert set('1234567890vwasdjliknN') | {' '} <= keys


@pytest.mark.parametrize(('gait', 'world'), [('trot', 'flat'), ('walk', 'boxes:0.05')])
def test_random_keys_make_nothing_fall(bench: Any, gait: str, world: str) -> None:
    tried = bench('legs_states').monkey('', [3000], 10.0, world=world, gait=gait)
    assert bench('trials').simulate(tried.runs[0]).report['falls'] == 0


def test_the_page_of_pairs_is_of_the_states_as_they_are(bench: Any) -> None:
    pairs = bench('state_pairs')
    result = json.loads(pairs.RESULT.read_text())
    assert pairs.PAGE.read_text() == pairs.page(result)
    states = pairs.STATES
    wanted = {f'{a.value} to {b.value}' for a in states for b in states if a is not b}
    assert result.keys() <= set(pairs.HOWS)
    for how, found in result.items():
        assert set(found['pairs']) == wanted, f'python benchmarks/state_pairs.py {how!r}'
        assert all(held == tried for held, tried in found['pairs'].values())


def test_what_follows_a_fall_is_not_counted_as_held(bench: Any) -> None:
    source, first, second, *_ = (state.value for state in StateName)
    trial = {'from': source, 'pair': f'{source} to {second}'}
    assert bench('state_pairs').counts([trial]) == {
        f'{source} to {first}': [1, 1],
        f'{source} to {second}': [0, 1],
    }


def test_states_that_end_by_themselves_are_left_in_their_middle(bench: Any) -> None:
    for source in (StateName.JUMP, StateName.GET_UP, StateName.LIE_DOWN):
        tour = bench('state_pairs').tour(source, 'at rest', 1)
        presses = parse_key_script(tour.run.keys, 'keys')
        key = bench('state_pairs').KEY_OF[source]
        let_go = tour.times[StateName.PASSIVE]
        entered = max(press.time for press in presses if press.key == key and press.time < let_go)
        assert let_go - entered < 1.3


def test_a_tour_goes_from_a_state_into_each_other(bench: Any) -> None:
    for source in bench('state_pairs').STATES:
        tour = bench('state_pairs').tour(source, 'at rest', 1)
        assert set(tour.times) == set(bench('state_pairs').STATES) - {source}
        wanted, begun = list(tour.times.items())[-1]
        assert tour.pair_at(begun) == f'{source.value} to {wanted.value}'


def test_a_push_in_the_swing_test_makes_nothing_that_follows_fall(bench: Any) -> None:
    """A small sample of benchmarks/state_pairs.py."""
    pairs = bench('state_pairs')
    into = (StateName.TROTTING, StateName.BALANCE_TEST)
    tour = pairs.tour(StateName.SWING_TEST, 'pushed by 15 N s', 3001, into)
    assert bench('trials').simulate(tour.run).report['fell_at'] is None
