# SPDX-License-Identifier: Apache-2.0
"""Keys that nobody has heard yet: kept in order, for as long as they mean the same."""

from teleop_keyboard.key_reader import LIFETIME, LIMIT, STATE_LIFETIME, WaitingKeys


def test_keys_come_out_once_and_in_order():
    waiting = WaitingKeys()
    for key in '24w':
        waiting.put(key)
    assert waiting.step(0.5 * LIFETIME) == []
    assert (waiting.take(), waiting.take()) == (['2', '4', 'w'], [])


def test_what_moves_is_dropped_soon_and_a_state_waits():
    waiting = WaitingKeys()
    for key in ('2', 'w', 'UP', ' '):
        waiting.put(key)
    assert waiting.step(1.01 * LIFETIME) == ['w', 'UP', ' ']
    assert len(waiting) == 1
    assert waiting.step(STATE_LIFETIME) == ['2']
    assert waiting.take() == []


def test_time_that_runs_backwards_makes_nothing_younger():
    waiting = WaitingKeys()
    waiting.put('w')
    for _ in range(100):
        waiting.step(0.6 * LIFETIME)
        waiting.step(-10.0)
    assert waiting.take() == []


def test_a_key_that_is_held_or_released_is_about_now_alone():
    waiting = WaitingKeys()
    waiting.put('HELD+w')
    waiting.put('RELEASE+w')
    assert waiting.take() == []


def test_no_flood_is_kept():
    waiting = WaitingKeys()
    for number in range(10 * LIMIT):
        waiting.put(str(number))
    assert waiting.take() == [str(9 * LIMIT + i) for i in range(LIMIT)]
