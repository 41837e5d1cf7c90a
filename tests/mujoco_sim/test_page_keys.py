# SPDX-License-Identifier: Apache-2.0
"""What counts as a key of the page: one press a tap, a keyboard's repeats, no ghosts."""

from cases import for_all
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.input import PAGE_KEYS, PageKeys
import pytest
from wasd_core.timing import HELD, LOST, RELEASE

from teleop_keyboard import keymap

W, A, SPACE = (int(key.value) for key in (imgui.Key.W, imgui.Key.A, imgui.Key.Space))
SHIFT, CTRL = int(imgui.Key.LeftShift.value), int(imgui.Key.RightCtrl.value)
RATES = (2.5, 3.0, 5.0, 10.0, 13.0, 30.0, 60.0, 144.0)


@pytest.fixture
def keys() -> PageKeys:
    """Return the keys of a page that has been seen with none of them down."""
    keys = PageKeys()
    keys.report((), 0.0)
    return keys


def hold(keys: PageKeys, seconds: float, rate: float, *down: int) -> list[str]:
    """Hold keys on a page that draws at a rate, let them go; return the presses."""
    for _ in range(max(round(seconds * rate), 1)):
        keys.report(down, 1.0 / rate)
        keys.step(1.0 / rate)
    keys.report((), 1.0 / rate)
    return presses(keys)


def presses(keys: PageKeys) -> list[str]:
    """Return what came without HELD and RELEASE."""
    return [key for key in keys.take() if not key.startswith((f'{HELD}+', f'{RELEASE}+'))]


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('seconds', [0.001, 0.15, 0.3])
def test_a_tap_is_one_press_whatever_the_rate_of_pictures(keys, rate, seconds):
    assert [hold(keys, seconds, rate, W) for _ in range(4)] == [['w']] * 4


def test_a_tap_is_one_press_when_its_reports_come_late_and_at_once(keys):
    keys.report({W}, 0.016)
    keys.report({W}, 0.49)  # the server was busy for half a second ...
    for _ in range(8):
        keys.report({W}, 0.0)
    keys.report((), 0.0)  # ... in which the key went up
    assert presses(keys) == ['w']


@pytest.mark.parametrize('rate', [rate for rate in RATES if rate >= 10.0])
def test_a_held_key_repeats_as_from_a_keyboard_whatever_the_rate_of_pictures(keys, rate):
    # One press, and after 0.45 s 30 a second.
    assert hold(keys, 3.0, rate, W).count('w') == pytest.approx(1 + 30 * 2.55, abs=4)


def test_a_held_key_is_told_to_be_down_and_its_end_at_once(keys):
    keys.report({W}, 0.02)
    assert keys.take() == ['w', 'HELD+w']
    told = 0
    for _ in range(50):
        keys.step(0.02)
        told += keys.take().count('HELD+w')
    assert told == pytest.approx(10, abs=1)
    keys.report((), 0.02)
    assert keys.take() == ['RELEASE+w']


def test_a_key_that_is_down_when_life_comes_back_counts_after_it_was_up(keys):
    keys.report({W}, 0.02)
    keys.lose()
    assert keys.take() == ['w', 'HELD+w', LOST, 'RELEASE+w']
    for _ in range(100):
        keys.report({W}, 0.02)
        keys.step(0.02)
    assert keys.take() == []
    keys.report((), 0.02)
    keys.report({W}, 0.02)
    assert keys.take() == ['w', 'HELD+w']


def test_another_key_counts_beside_one_that_is_no_longer_believed(keys):
    keys.report({W}, 0.02)
    keys.lose()
    keys.report({W}, 0.02)
    keys.take()
    keys.report({W, A}, 0.02)
    assert keys.take() == ['a', 'HELD+a']


def test_keys_that_are_down_on_the_first_report_do_not_count():
    keys = PageKeys()
    keys.report({W}, 0.0)
    assert keys.take() == []


def test_a_key_keeps_its_name_when_shift_goes_first(keys):
    keys.report({SHIFT, W}, 0.02)
    keys.report({W}, 0.02)
    keys.report((), 0.02)
    assert keys.take() == ['W', 'HELD+W', 'RELEASE+W']


def test_a_shortcut_of_the_browser_is_no_key(keys):
    keys.report({CTRL, W}, 0.02)
    keys.report({W}, 0.02)
    keys.report((), 0.02)
    assert keys.take() == []


def test_nobody_who_reads_costs_no_memory(keys):
    for _ in range(5000):
        keys.report({W}, 0.02)
        keys.report((), 0.02)
    assert len(keys.take()) <= 1000


def test_events_are_named_as_the_keyboard_names_them(keys):
    keys.report({SPACE}, 0.02)
    keys.report((), 0.02)
    assert keys.take() == [' ', 'HELD+SPACE', 'RELEASE+SPACE']


def test_every_name_of_a_page_key_is_one_of_a_keyboard():
    names = {name for pair in PAGE_KEYS.values() for name in pair}
    assert {keymap.canonical_key(name) for name in names} == names


@for_all(
    ('plain', 'shifted'), list(zip("`1234567890-=[]\\;',./", '~!@#$%^&*()_+{}|:"<>?', strict=True))
)
def test_shift_gives_the_character_of_a_us_keyboard(plain, shifted):
    assert (plain, shifted) in PAGE_KEYS.values()
