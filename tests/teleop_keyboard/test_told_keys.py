# SPDX-License-Identifier: Apache-2.0
"""Keys that a terminal tells to be down are down as long as it goes on telling."""

from cases import for_all
import pytest
from teleop_keyboard.decoder import KeyDecoder
from teleop_keyboard.told_keys import ToldKeys

STEP = 0.002
RATE = 30.0


def end_of(told, events, until=5.0):
    """Play events (time, method, *arguments); return when (time, ends) all keys were given up."""
    waiting, ends = list(events), []
    for index in range(round(until / STEP)):
        now = index * STEP
        told.step(STEP)
        while waiting and waiting[0][0] <= now + 1e-9:
            _, method, *words = waiting.pop(0)
            getattr(told, method)(*words)
        if given_up := told.give_up():
            ends.append((now, given_up))
    return ends


def held(place, name, start, delay, count):
    """Return the press of a key at `start` [s] and `count` repeats."""
    repeats = [start + delay + index / RATE for index in range(count)]
    return [
        (start, 'press', place, name, False),
        *((when, 'press', place, name, True) for when in repeats),
    ]


def test_a_press_that_does_not_repeat_ends_after_0_6_s_with_a_stop():
    ((end, events),) = end_of(ToldKeys(), [(0.1, 'press', '105u', 'i', False)])
    assert end - 0.1 == pytest.approx(0.6, abs=2 * STEP)
    assert events == ['RELEASE+i', 'STOP']


@for_all('delay', [0.2, 0.5, 0.59])
def test_a_key_that_repeats_ends_0_3_s_after_its_last_repeat_and_not_before(delay):
    events = held('105u', 'i', 0.1, delay, 30)
    ((end, ended),) = end_of(ToldKeys(), events)
    assert end - events[-1][0] == pytest.approx(0.3, abs=2 * STEP)
    assert ended == ['RELEASE+i', 'STOP']


def test_a_repeat_that_is_told_as_a_press_is_a_repeat():
    events = [
        (when, 'press', place, name, False)
        for when, _, place, name, _ in held('1A', 'UP', 0.0, 0.5, 20)
    ]
    ((end, _),) = end_of(ToldKeys(), events)
    assert end - events[-1][0] == pytest.approx(0.3, abs=2 * STEP)


def test_keys_of_a_chord_live_on_the_repeats_of_the_last_one():
    told = ToldKeys()
    events = [(0.0, 'press', '119u', 'w', False), *held('97u', 'a', 0.3, 0.5, 60)]
    ((end, ended),) = end_of(told, events)
    assert end - events[-1][0] == pytest.approx(0.3, abs=2 * STEP)
    assert ended == ['RELEASE+w', 'RELEASE+a', 'STOP']


def test_the_older_key_of_a_chord_ends_without_a_stop_when_the_last_one_is_let_go():
    """It is silent on every terminal; nobody can tell whether it is still down."""
    events = [(0.0, 'press', '119u', 'w', False), *held('97u', 'a', 0.3, 0.5, 20)]
    let_go = events[-1][0] + 0.01
    ((end, ended),) = end_of(ToldKeys(), [*events, (let_go, 'release', '97u')])
    assert end - let_go == pytest.approx(0.3, abs=2 * STEP)
    assert ended == ['RELEASE+w']


def test_the_release_of_an_older_key_takes_nothing_from_the_last_one():
    """From w to a: a has half a second to repeat, although w is let go meanwhile."""
    events = [(0.0, 'press', '119u', 'w', False), *held('97u', 'a', 0.1, 0.55, 20)]
    events = sorted([*events, (0.15, 'release', '119u')], key=lambda event: event[0])
    ((end, ended),) = end_of(ToldKeys(), events)
    assert end > events[-1][0]
    assert ended == ['RELEASE+a', 'STOP']


def test_a_key_that_is_let_go_is_over_and_nothing_follows():
    assert end_of(ToldKeys(), [*held('105u', 'i', 0.0, 0.5, 9), (0.9, 'release', '105u')]) == []


def test_a_keyboard_that_waits_longer_is_believed_after_two_keys():
    told = ToldKeys()
    for _ in range(2):
        ends = end_of(told, [*held('105u', 'i', 0.1, 0.66, 20), (1.6, 'release', '105u')], 3.0)
        assert len(ends) == 1  # between the press and its first repeat
    assert end_of(told, [*held('105u', 'i', 0.1, 0.66, 20), (1.6, 'release', '105u')], 3.0) == []
    # And one repeat that comes late on a quick keyboard changes nothing.
    told = ToldKeys()
    end_of(told, [*held('105u', 'i', 0.0, 0.7, 20), (1.6, 'release', '105u')], 2.0)
    ((end, _),) = end_of(told, [(0.0, 'press', '105u', 'i', False)])
    assert end == pytest.approx(0.6, abs=2 * STEP)


REPEAT, RELEASE = b'\x1b[105;1:2;105u', b'\x1b[105;1:3u'


def test_a_terminal_that_tells_repeats_tells_releases_whatever_it_has_answered():
    decoder = KeyDecoder()
    assert decoder.feed(b'\x1b[105;;105u') == ['i']
    assert decoder.down == ()
    decoder.feed(REPEAT)
    assert decoder.down == ('i',)
    decoder.step(0.31)
    assert decoder.give_up() == ['RELEASE+i', 'STOP']
    assert decoder.feed(RELEASE) == []


def test_an_answer_that_comes_while_a_key_is_down_leaves_it_down_for_as_long_as_it_repeats():
    decoder = KeyDecoder()
    decoder.feed(b'\x1b[105;;105u')
    decoder.step(0.5)
    assert decoder.feed(b'\x1b[?0u') == []
    assert decoder.down == ('i',)
    decoder.step(0.11)
    assert decoder.give_up() == ['RELEASE+i', 'STOP']


def test_where_releases_are_not_told_nothing_ends_by_itself():
    decoder = KeyDecoder()
    decoder.feed(b'\x1b[A')
    decoder.step(10.0)
    assert decoder.give_up() == []
    decoder.feed(b'\x1b[?0u')
    assert decoder.down == ()


def test_shift_pressed_while_a_key_is_down_ends_its_first_name():
    decoder = KeyDecoder()
    told = []
    for word in (b'\x1b[?0u', b'\x1b[119;1:1u', b'\x1b[119;2:2;87u', b'\x1b[119;2:3u'):
        told += decoder.feed(word)
    assert told == ['w', 'RELEASE+w', 'W', 'RELEASE+W']
    assert decoder.down == ()
