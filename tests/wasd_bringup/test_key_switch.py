# SPDX-License-Identifier: Apache-2.0
"""One keyboard for several robots: no key reaches two, no end of a key reaches the wrong one."""

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.input import PageKeys
from teleop_keyboard.decoder import KeyDecoder
from wasd_bringup.run.run import KeySwitch
from wasd_core.timing import HELD, with_event

L, TAB = int(imgui.Key.L.value), int(imgui.Key.Tab.value)
PICTURE = 0.02  # from one picture of a page to the next [s]


def receivers(switch: KeySwitch, keys: str) -> list[int | None]:
    """Return who gets each of the keys, which are parted by blanks."""
    return [switch.receiver(key) for key in keys.split()]


def test_tab_goes_from_robot_to_robot_and_is_for_none() -> None:
    assert receivers(KeySwitch(2), 'w TAB i TAB w') == [0, None, 1, None, 0]


def test_who_is_left_is_told_once_for_each_press() -> None:
    switch = KeySwitch(2)
    left: list[int] = []
    switch.on_leave.append(left.append)
    receivers(switch, 'w TAB HELD+TAB RELEASE+TAB i TAB')
    assert left == [0, 1]


def test_with_one_robot_tab_is_a_key_like_any_other() -> None:
    assert receivers(KeySwitch(1), 'w TAB HELD+TAB') == [0, 0, 0]


def test_a_key_held_over_a_switch_stays_with_its_robot_to_its_end() -> None:
    keys = 'w HELD+w TAB HELD+w i HELD+i RELEASE+w RELEASE+i'
    assert receivers(KeySwitch(2), keys) == [0, 0, None, 0, 1, 1, 0, 1]


def test_holding_tab_switches_once() -> None:
    assert receivers(KeySwitch(2), 'TAB HELD+TAB HELD+TAB RELEASE+TAB w') == [None] * 4 + [1]


def test_a_key_let_go_begins_anew_with_the_robot_of_then() -> None:
    keys = 'HELD+w RELEASE+w TAB HELD+w RELEASE+w'
    assert receivers(KeySwitch(2), keys) == [0, 0, None, 1, 1]


def test_a_key_that_shift_renamed_begins_anew_with_the_robot_of_then() -> None:
    decoder, keys = KeyDecoder(), []
    pressed, renamed, released = b'\x1b[119;1:1u', b'\x1b[119;2:2;87u', b'\x1b[119;2:3u'
    for word in (b'\x1b[?0u', pressed, renamed, released, b'\x1b[9;1:1u\x1b[9;1:3u', pressed):
        keys += decoder.feed(word)
        keys += [with_event(HELD, key) for key in decoder.down]
    assert keys[-2:] == ['w', 'HELD+w']
    assert receivers(KeySwitch(2), ' '.join(keys))[-2:] == [1, 1]


def test_a_key_held_on_the_page_over_a_switch_repeats_for_its_robot_alone() -> None:
    keys, switch = PageKeys(), KeySwitch(2)
    keys.report((), PICTURE)

    def hold(seconds: float, *down: int) -> list[tuple[str, int | None]]:
        for _ in range(round(seconds / PICTURE)):
            keys.report(down, PICTURE)
            keys.step(PICTURE)
        return [(key, switch.receiver(key, 'page')) for key in keys.take()]

    assert hold(1.0, L).count(('l', 0)) > 10
    assert hold(0.1, L, TAB)[-1][1] is None
    told = hold(1.0, L)
    assert told.count(('l', 0)) > 20
    assert {receiver for _, receiver in told} == {0, None}
    assert hold(0.1) == [('RELEASE+l', 0)]
    assert hold(0.1, L)[0] == ('l', 1)


def test_repeats_of_tab_switch_no_more() -> None:
    assert receivers(KeySwitch(2), 'TAB HELD+TAB TAB RELEASE+TAB w') == [None] * 4 + [1]


def test_a_key_that_one_source_holds_is_another_sources_own() -> None:
    switch = KeySwitch(2)
    receivers(switch, 'HELD+w HELD+TAB')
    assert switch.receiver('TAB', 'page') is None
    told = [switch.receiver(key, 'page') for key in ('w', 'HELD+w', 'RELEASE+w')]
    assert told == [1, 1, 1]
    assert receivers(switch, 'w RELEASE+w w') == [0, 0, 1]
