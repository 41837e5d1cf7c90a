# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

from cases import for_all
import pytest
from teleop_keyboard.keymap import KeymapError
from teleop_keyboard.keymap_file import load_preset, OPTIONAL, preset_names, read_keymap, REQUIRED
from wasd_core.parameters import InvalidParameter

GOOD = """\
motion:
  i: [1, 0, 0]
  '1': [0, 0, 1]
speed: 0.2
turn: 1.0
linear_accel: 0.6
angular_accel: 3.0
"""

# mbot_teleop's tables, key -> (x, th) and key -> (factor of speed, factor of turn).
MBOT_MOTION = {
    'i': (1, 0),
    'o': (1, -1),
    'j': (0, 1),
    'l': (0, -1),
    'u': (1, 1),
    ',': (-1, 0),
    '.': (-1, 1),
    'm': (-1, -1),
}
MBOT_SPEED = {
    'q': (1.1, 1.1),
    'z': (0.9, 0.9),
    'w': (1.1, 1),
    'x': (0.9, 1),
    'e': (1, 1.1),
    'c': (1, 0.9),
}
# keys_to_twist_with_ramps' table, key -> [angular, linear].
RAMPS_MOTION = {'w': (0, 1), 'x': (0, -1), 'a': (1, 0), 'd': (-1, 0), 's': (0, 0)}


def test_mbot_is_the_table_of_mbot_teleop():
    keymap = load_preset('mbot')
    assert {key: (way.x, way.yaw) for key, way in keymap.motion.items()} == MBOT_MOTION
    assert all(way.y == 0 for way in keymap.motion.values())
    assert dict(keymap.speed_keys) == MBOT_SPEED
    assert keymap.stop_keys == {' ', 'k'}
    assert (keymap.speed, keymap.turn) == (0.2, 1.0)
    # 0.02 m/s and 0.1 rad/s a loop, 30 loops a second.
    assert keymap.linear_accel == pytest.approx(0.02 * 30)
    assert keymap.angular_accel == pytest.approx(0.1 * 30)
    assert (keymap.mode, keymap.other_keys, keymap.idle) == ('hold', 'stop', 'silent')


def test_ramps_is_the_table_of_keys_to_twist_with_ramps():
    keymap = load_preset('ramps')
    assert {key: (way.yaw, way.x) for key, way in keymap.motion.items()} == RAMPS_MOTION
    assert not keymap.speed_keys
    assert not keymap.stop_keys
    assert (keymap.speed, keymap.turn) == (0.5, 0.5)
    assert (keymap.linear_accel, keymap.angular_accel, keymap.rate) == (1.0, 1.0, 20.0)
    assert keymap.first_character_only
    assert (keymap.mode, keymap.other_keys, keymap.idle) == ('latch', 'ignore', 'repeat')


@for_all('name', preset_names())
def test_every_preset_explains_its_keys(name):
    keymap = load_preset(name)
    text = '\n'.join(keymap.help_lines)
    for key in [*keymap.motion, *keymap.speed_keys]:
        assert key in text
    assert all(len(line) < 80 for line in keymap.help_lines)


def test_a_digit_stays_the_key_that_it_is():
    assert set(read_keymap(GOOD, 'mine.yaml', 'mine').motion) == {'i', '1'}


def test_a_fourth_share_is_up():
    keymap = read_keymap(GOOD.replace('[1, 0, 0]', '[0.5, 0, 1, -1]'), 'mine.yaml', 'mine')
    assert keymap.motion['i'] == (0.5, 0, 1, -1)
    assert keymap.axes == (0, 2, 3)


def test_the_page_on_the_keyboard_shows_a_keymap_that_works_and_every_preset():
    page = (Path(__file__).parents[2] / 'docs' / 'keyboard.md').read_text()
    keymap = read_keymap(page.split('```yaml\n')[1].split('```')[0], 'keyboard.md', 'mine')
    assert keymap.motion['PGUP'] == (0, 0, 1, 0)
    assert keymap.stop_keys == {' ', 'x'}
    assert all(f'| `{name}` |' in page for name in preset_names())
    fields = {*REQUIRED, *OPTIONAL}
    assert all(f'\n{name}: ' in page or f'\n{name}:' in page for name in fields)


def test_a_file_is_found_by_its_path(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(GOOD)
    assert load_preset(str(path)).name == 'mine'


@for_all(
    ('old', 'new', 'line', 'message'),
    [
        ('speed: 0.2', 'speeed: 0.2', 4, 'speeed: unknown field, did you mean speed?'),
        ('speed: 0.2\n', '', 1, 'speed: is missing'),
        ('speed: 0.2', 'speed: fast', 4, "speed: must be a number, got 'fast'"),
        ('speed: 0.2', 'speed: .nan', 4, "speed: must be a number, got '.nan'"),
        (
            'linear_accel: 0.6',
            'linear_accel: 0',
            6,
            'linear_accel: must be >= 0.05 and <= 1000',
        ),
        ('i: [1, 0, 0]', 'i: [1, 0]', 2, 'i: must be a list of 3 numbers'),
        ('i: [1, 0, 0]', 'i: [1, 0, 0, 0, 0]', 2, 'i: must be a list of 3 numbers'),
        ('i: [1, 0, 0]', 'i: [1, 0, -2, 0]', 2, 'i: each share must be within -1 and 1'),
        ('i: [1, 0, 0]', 'i: [2, 0, 0]', 2, 'i: each share must be within -1 and 1, got 2'),
        ('i: [1, 0, 0]', 'CTRL+c: [1, 0, 0]', 2, 'CTRL+c: ends or suspends the program'),
        ('i: [1, 0, 0]', 'HELD+i: [1, 0, 0]', 2, 'HELD+i: is no press: name the key alone'),
        ('i: [1, 0, 0]', 'SHIFT+i: [1, 0, 0]', 2, 'SHIFT+i: never arrives: name the character '),
        ('i: [1, 0, 0]', 'SHIFT+SPACE: [1, 0, 0]', 2, 'that it types, as SPACE'),
        ('i: [1, 0, 0]', 'SHIFT+9: [1, 0, 0]', 2, 'SHIFT+9: never arrives: name the char'),
        ('i: [1, 0, 0]', 'i: [x, 0, 0]', 2, "i: must be a number, got 'x'"),
        ('i: [1, 0, 0]', 'UPP: [1, 0, 0]', 2, "'UPP': unknown key 'UPP', did you mean UP?"),
        ("'1': [0, 0, 1]", 'i: [0, 0, 1]', 3, 'i: appears here for the second time'),
        ("'1': [0, 0, 1]", '{a: b}: [0, 0, 1]', 3, 'motion: a key must be text'),
        ('turn: 1.0', 'turn: 1.0\nstop: [i]', 6, "stop: key 'i' is bound under motion, too"),
        ('turn: 1.0', 'turn: 1.0\nstop: k', 6, 'stop: must be a list of keys'),
        (
            'turn: 1.0',
            'turn: 1.0\nmode: hodl',
            6,
            "mode: must be hold or latch or step, got 'hodl'",
        ),
        ('turn: 1.0', 'turn: 1.0\nspeed_limits: [0.5, 1]', 4, 'speed: must be within speed_limi'),
        ('turn: 1.0', 'turn: 1.0\nspeed_keys: {q: [0, 1]}', 6, 'q: both factors must be > 0'),
        ('turn: 1.0', 'turn: [1.0', 6, "expected ',' or ']'"),
        ('turn: 1.0', 'turn: 1.0\nrate: 1e9', 6, 'rate: must be >= 1 and <= 500, got 1e+09'),
        ('turn: 1.0', 'turn: 1.0\nturn_limits: [0, 1e9]', 6, 'turn_limits: must be 0 <= small'),
        ('turn: 1.0', 'turn: 1\x07', 5, 'special characters are not allowed'),
        ('turn: 1.0', 'turn: 1.0\n---\nturn: 2', 6, 'but found another document'),
        ('turn: 1.0', 'turn: *there', 5, "found undefined alias 'there'"),
        ('turn: 1.0', 'turn: &a [*a]', 5, 'turn: must be one value'),
    ],
)
def test_an_error_names_file_line_and_key(old, new, line, message):
    assert old in GOOD
    with pytest.raises(KeymapError) as caught:
        read_keymap(GOOD.replace(old, new), 'mine.yaml', 'mine')
    assert str(caught.value).startswith(f'mine.yaml:{line}: ')
    assert message in str(caught.value)


@for_all('text', ['', '- a', 'word', '\t'])
def test_text_that_is_no_mapping_is_an_error(text):
    with pytest.raises(KeymapError, match='mine.yaml'):
        read_keymap(text, 'mine.yaml', 'mine')


def test_a_keymap_that_moves_nothing_is_an_error():
    text = 'speed: 1\nturn: 1\nlinear_accel: 1\nangular_accel: 1\nmotion: {}'
    with pytest.raises(KeymapError, match='mine.yaml:5: motion: names no key'):
        read_keymap(text, 'mine.yaml', 'mine')


def test_without_limits_a_speed_key_ends_somewhere():
    keymap = read_keymap(GOOD + 'speed_keys: {q: [1.1, 1.1]}', 'mine.yaml', 'mine')
    assert keymap.speed_limits == keymap.turn_limits == (0.0, 100.0)


def test_a_file_that_is_no_text_is_one_line_that_names_the_place(tmp_path):
    path = tmp_path / 'latin.yaml'
    path.write_bytes(b'# one\n# two \xe9\n')
    with pytest.raises(KeymapError, match='latin.yaml:2: not UTF-8 text'):
        load_preset(str(path))


def test_an_unknown_preset_lists_the_known_ones():
    with pytest.raises(KeymapError, match=r"'mbto', did you mean mbot\? \(known: .*ramps"):
        load_preset('mbto')


@for_all('folder', ['/nowhere', '~nobody-of-that-name'])
def test_a_missing_file_is_one_line_that_names_it(folder):
    with pytest.raises(InvalidParameter, match='none.yaml: cannot read the keymap: No such file'):
        load_preset(f'{folder}/none.yaml')
