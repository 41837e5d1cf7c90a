# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.hold import KeyHold

STEP = 0.002


def time_held(hold, presses, end, key='i'):
    """Return when `key` counted as held, as (first, last) instants [s] without a gap, or None."""
    waiting = list(presses)
    spans = []
    for index in range(round(end / STEP)):
        now = index * STEP
        while waiting and waiting[0] <= now + 1e-9:
            hold.press(key)
            waiting.pop(0)
        if key in hold.held:
            if not spans or spans[-1][1] < now - 1.5 * STEP:
                spans.append([now, now])
            spans[-1][1] = now
        hold.step(STEP)
    return spans


def test_a_tap_counts_until_a_keyboard_would_have_repeated():
    ((start, end),) = time_held(KeyHold(), [0.1], 2.0)
    assert start == pytest.approx(0.1, abs=STEP)
    assert end - start == pytest.approx(0.6, abs=2 * STEP)


@for_all('delay', [0.2, 0.25, 0.5, 0.55])
@for_all('gap', [1 / 30, 1 / 50, 1 / 15])
def test_a_held_key_is_held_without_a_gap_and_released_soon(delay, gap):
    presses = [0.0] + [delay + index * gap for index in range(40)]
    ((start, end),) = time_held(KeyHold(), presses, presses[-1] + 1.0)
    assert start == 0.0
    assert end - presses[-1] == pytest.approx(max(0.12, 2.5 * gap), abs=3 * STEP)


def test_release_is_seen_within_150_ms_at_30_hz():
    presses = [0.0] + [0.5 + index / 30 for index in range(30)]
    ((_, end),) = time_held(KeyHold(), presses, 3.0)
    assert end - presses[-1] <= 0.15


def test_a_slow_keyboard_is_given_more_time_but_not_more_than_a_first_press():
    ((_, end),) = time_held(KeyHold(), [0.0, 0.5, 0.9, 1.3, 1.7], 4.0)
    assert end - 1.7 == pytest.approx(0.6, abs=3 * STEP)


def test_one_late_delivery_does_not_release_a_key():
    presses = [0.0] + [0.5 + index / 30 for index in range(20)]
    late = presses[-1] + 0.1
    spans = time_held(KeyHold(), [*presses, late, late + 1 / 30], 3.0)
    assert len(spans) == 1


def test_a_burst_in_one_instant_is_one_press():
    hold = KeyHold()
    for _ in range(50):
        hold.press('i')
    hold.step(0.59)
    assert hold.held == ('i',)
    hold.step(0.02)
    assert hold.held == ()


def test_keys_are_held_in_the_order_of_their_first_press():
    hold = KeyHold()
    for key in 'wdw':
        hold.press(key)
    assert hold.held == ('w', 'd')
    hold.release('w')
    assert hold.held == ('d',)
    hold.clear()
    assert hold.held == ()


def test_a_long_step_releases_and_no_time_releases_nothing():
    hold = KeyHold()
    hold.press('i')
    hold.step(0.0)
    assert hold.held == ('i',)
    hold.step(100.0)
    assert hold.held == ()


def typed(hold, delay, gap=1 / 30, count=20, key='i'):
    """Hold a key on a keyboard and let it go; return how long it counted after the last press."""
    presses = [0.0] + [delay + index * gap for index in range(count)]
    spans = time_held(hold, presses, presses[-1] + 1.5, key)
    return spans, presses[-1]


@for_all('delay', [0.2, 0.25, 0.5])
def test_the_delay_of_the_keyboard_is_learnt_so_a_tap_counts_no_longer(delay):
    hold = KeyHold()
    typed(hold, delay)
    assert hold.first_timeout == pytest.approx(1.15 * delay + 0.03, abs=0.01)
    ((_, end),) = time_held(hold, [0.0], 2.0, 'j')
    assert end == pytest.approx(hold.first_timeout, abs=3 * STEP)
    # And the next hold has no gap, at the same keyboard.
    spans, _ = typed(hold, delay, key='j')
    assert len(spans) == 1


def test_a_delay_longer_than_was_thought_stutters_once_and_never_again():
    hold = KeyHold()
    spans, _ = typed(hold, 0.66)
    assert len(spans) == 2
    spans, _ = typed(hold, 0.66)
    assert len(spans) == 1


def test_quick_taps_are_not_taken_for_a_delay():
    hold = KeyHold()
    time_held(hold, [0.0, 0.3, 0.38, 0.55, 0.61, 0.8], 2.0)
    assert hold.first_timeout == 0.6


def test_keys_pressed_together_are_down_together_until_the_last_is_released():
    hold = KeyHold()
    hold.press('w')
    hold.step(0.05)
    hold.press('d')
    # Only d repeats from now on.
    hold.step(0.5)
    for _ in range(30):
        hold.press('d')
        assert hold.held == ('w', 'd')
        hold.step(1 / 30)
    for _ in range(70):
        hold.step(STEP)
    assert hold.held == ()


def test_a_key_pressed_later_ends_the_one_before():
    hold = KeyHold()
    hold.press('w')
    hold.step(0.3)
    hold.press('d')
    hold.step(STEP)
    assert hold.held == ('d',)
