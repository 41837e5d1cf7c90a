# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.dashboard import driving_keys, KeyHints, Status, status_line
from teleop_keyboard.keymap import LAYOUTS, NAMED_KEYS
from teleop_keyboard.keymap_file import load_preset, preset_names
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_core.timing import brief, is_press

KEYS = (*map(chr, range(32, 127)), *sorted(NAMED_KEYS), 'CTRL+ALT+SHIFT+DOWN')
WHEELS = ('x', 'yaw')


def hints(preset, **options):
    logic = KeysToTwist(load_preset(preset))
    return logic, KeyHints(logic, '?', **options)


def test_w_on_mbot_says_what_drives_and_what_w_is_twice_then_in_short():
    _, given = hints('mbot', advice='or start with --preset wasd')
    lesson = 'drive with i , j l; w is speed +10 % (or start with --preset wasd)'
    assert [given.press('w') for _ in range(4)] == [lesson] * 2 + ['w is speed +10 %'] * 2


@pytest.mark.parametrize('preset', preset_names())
@pytest.mark.parametrize('layout', LAYOUTS)
def test_every_key_that_does_not_drive_is_answered_in_what_80_columns_leave(preset, layout):
    try:
        logic = KeysToTwist(load_preset(preset, layout))
    except ValueError:
        pytest.skip('two keys in one place')
    given = KeyHints(logic, '?', advice='or start with --preset wasd', axes=WHEELS)
    for key in KEYS:
        logic.press(key)
        said = given.press(key)
        base = key[:1] if logic.keymap.first_character_only else key
        way = logic.keymap.motion.get(base)
        drives = way is not None and bool(way.x or way.yaw)
        assert (said is None) == drives, key
        line = status_line(Status('[mbot] timed out', (), said or ''), '1234.5 s x1.00', 79)
        assert brief(said or '') in line, key


def test_a_speed_key_at_its_end_says_so():
    logic, given = hints('mbot')
    for _ in range(50):
        logic.press('x')
    assert given.press('x') == 'x is speed -10 %, at its end'
    logic.press('w')
    assert 'at its end' not in given.press('w')
    assert given.press('z') == 'z is both -10 %'


def test_a_way_that_wheels_cannot_go_is_no_silence():
    _, given = hints('wasd', axes=WHEELS)
    assert given.press('q') == 'drive with w s a d (q is left)'
    assert hints('wasd')[1].press('q') is None


def test_keys_that_mean_nothing_say_so_and_name_the_help():
    assert hints('mbot')[1].press('9') == '9 stops (? shows the keys)'
    assert hints('ramps')[1].press('9') == '9 does nothing (? shows the keys)'
    # A program may publish any text as a key.
    assert hints('ramps')[1].press('9' * 60000) == f'{"9" * 20} does nothing (? shows the keys)'
    assert hints('mbot')[1].press(' ') == 'SPACE stops at once'


@for_all(
    ('preset', 'keys'),
    [('mbot', 'i , j l'), ('wasd', 'w s a d'), ('ramps', 'w x a d'), ('go2', 'w x r t')],
)
def test_the_driving_keys_are_those_of_the_keymap(preset, keys):
    assert driving_keys(load_preset(preset)) == keys


def test_only_presses_are_answered():
    assert is_press('w')
    assert not is_press('HELD+w')
    assert not is_press('RELEASE+w')
    assert not is_press('')
