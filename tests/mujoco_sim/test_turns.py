# SPDX-License-Identifier: Apache-2.0
"""Who has control of a page, who waits for it, and when it goes from one to the other."""

import math

from mujoco_sim.viewer.clicks import Mouse
from mujoco_sim.viewer.input import PageInput
from mujoco_sim.viewer.turns import GIVEN_AFTER, Turns
import pytest


class Clock:
    """A clock that stands still until it is told."""

    now = 100.0

    def __call__(self) -> float:
        """Return the time."""
        return self.now


@pytest.fixture
def clock() -> Clock:
    """Return a clock."""
    return Clock()


@pytest.fixture
def turns(clock: Clock) -> Turns:
    """Return the turns of a page on which somebody drives."""
    return Turns(clock)


def test_nobody_loses_control_while_nobody_asks(turns, clock):
    clock.now += 1e6
    assert turns.remaining == math.inf
    turns.give()
    assert not turns.take_end()


def test_control_goes_once_the_drivers_hands_have_rested_since_it_was_asked_for(turns, clock):
    clock.now += 1000.0
    turns.ask('a')
    clock.now += GIVEN_AFTER - 0.5
    assert turns.remaining == pytest.approx(0.5)
    assert not turns.take_end()
    clock.now += 1.0
    assert turns.take_end()
    turns.leave('a')
    assert not turns.take_end()


def test_hands_that_do_something_keep_control(turns, clock):
    turns.ask('a')
    for _ in range(20):
        clock.now += 0.9 * GIVEN_AFTER
        turns.touch()
        assert not turns.take_end()
    assert turns.remaining == GIVEN_AFTER


def test_control_that_is_given_goes_at_once_and_only_once(turns):
    turns.ask('a')
    turns.ask('b')
    turns.give()
    assert turns.take_end()
    turns.leave('a')
    assert turns.waiting == 1
    assert not turns.take_end()  # b waits for the one whose turn has begun


def test_who_does_not_take_control_ends_one_turn_alone(turns, clock):
    turns.ask('a')
    clock.now += 1.5 * GIVEN_AFTER
    assert turns.take_end()
    clock.now += 10.0 * GIVEN_AFTER
    assert turns.waiting == 0
    assert not turns.take_end()
    turns.ask('a')
    clock.now += 1.5 * GIVEN_AFTER
    assert turns.take_end()


def test_who_gives_up_waiting_takes_nothing(turns, clock):
    turns.ask('a')
    turns.leave('a')
    clock.now += 10.0 * GIVEN_AFTER
    assert turns.waiting == 0
    assert not turns.take_end()


def test_control_given_to_one_who_leaves_is_not_for_who_asks_later(turns, clock):
    turns.ask('a')
    turns.give()
    turns.leave('a')
    assert not turns.take_end()
    turns.ask('b')
    assert not turns.take_end()
    assert turns.remaining == pytest.approx(GIVEN_AFTER)


def test_control_given_to_several_is_there_for_those_who_stay(turns):
    turns.ask('a')
    turns.ask('b')
    turns.give()
    turns.leave('a')
    assert turns.take_end()


def test_asking_again_does_not_begin_the_time_anew_and_the_first_counts(turns, clock):
    turns.ask('a')
    clock.now += 0.6 * GIVEN_AFTER
    turns.ask('a')
    turns.ask('b')
    assert turns.remaining == pytest.approx(0.4 * GIVEN_AFTER)


@pytest.mark.parametrize(
    'does',
    [
        (frozenset({550}),),
        (frozenset(), Mouse(1)),
        (frozenset(), Mouse(0, (3, 4))),
    ],
)
def test_a_key_a_button_and_a_pointer_that_moves_are_hands(clock, does):
    page = PageInput(clock)
    page.hear('page', frozenset())
    page.turns.ask('a')
    clock.now += 0.5 * GIVEN_AFTER
    page.hear('page', frozenset())
    assert page.turns.remaining == 0.5 * GIVEN_AFTER
    page.hear('page', *does)
    assert page.turns.remaining == GIVEN_AFTER
