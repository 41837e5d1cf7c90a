# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.keymap import KeymapError, LAYOUTS, on_layout, on_qwerty, places
from teleop_keyboard.keymap_file import (
    describe_keymap,
    list_presets,
    load_preset,
    preset_names,
    read_keymap,
)
from wasd_bringup.cli import main


@for_all(('layout', 'names'), [('azerty', 'zqsd'), ('dvorak', ',aoe'), ('qwerty', 'wasd')])
def test_wasd_is_where_the_hand_is(layout, names):
    assert ''.join(on_layout(key, layout) for key in 'wasd') == names
    motion = load_preset('wasd', layout).motion
    assert motion[names[0]] == (1, 0, 0, 0)
    assert motion[names[1]] == (0, 0, 0, 1)


@for_all('layout', LAYOUTS)
def test_a_layout_gives_every_place_a_name_of_its_own(layout):
    table = places(layout)
    assert len(set(table.values())) == len(table) == 70


@for_all('layout', LAYOUTS)
def test_the_way_back_to_qwerty_undoes_a_layout(layout):
    for key in [*places(layout), 'UP', ' ', '1', 'CTRL+W', 'ALT+SHIFT+UP']:
        assert on_qwerty(on_layout(key, layout), layout) == key


def test_other_keys_and_modifiers_stay():
    assert on_layout('UP', 'dvorak') == 'UP'
    assert on_layout('1', 'azerty') == '1'
    assert on_layout('CTRL+W', 'azerty') == 'CTRL+Z'
    assert on_layout('W', 'azerty') == 'Z'
    assert [on_layout(key, 'azerty') for key in 'M<>'] == ['?', '.', '/']


@for_all('layout', LAYOUTS)
@for_all('name', preset_names())
def test_every_preset_works_and_explains_itself_on_every_keyboard(name, layout):
    keymap = load_preset(name, layout)
    there = load_preset(name)
    assert len(keymap.motion) == len(there.motion)
    assert list(keymap.motion.values()) == list(there.motion.values())
    text = '\n'.join(keymap.help_lines)
    assert layout == 'qwerty' or 'w a s d' not in text
    assert all(key in text for key in [*keymap.motion, *keymap.speed_keys])
    assert all(len(line) < 80 for line in keymap.help_lines)


def test_two_keys_that_become_one_are_an_error(tmp_path, monkeypatch):
    path = tmp_path / 'mine.yaml'
    path.write_text(
        "motion: {'[': [1, 0, 0], '^': [-1, 0, 0]}\n"
        'speed: 1\nturn: 1\nlinear_accel: 1\nangular_accel: 1\n'
    )
    assert read_keymap(path.read_text(), 'mine.yaml', 'mine').motion
    with pytest.raises(KeymapError, match=r'mine: \[ and \^ are one key on azerty'):
        load_preset(str(path), 'azerty')


@pytest.mark.slow
def test_wasd_keys_lists_the_presets(capsys):
    assert main(['keys']) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in ('arrows', 'go2', 'mbot', 'ramps', 'unitree', 'wasd'))
    assert all(len(line) < 80 for line in list_presets())


@pytest.mark.slow
def test_wasd_keys_prints_a_keymap_for_a_keyboard(capsys):
    assert main(['keys', 'wasd', '--layout', 'azerty']) == 0
    shown = capsys.readouterr().out
    assert '  z            forward\n' in shown
    assert '  q            turn left\n' in shown
    assert '  SPACE        stop at once\n' in shown


@pytest.mark.slow
def test_wasd_keys_prints_the_go2s_own_keys(capsys):
    assert main(['keys', 'unitree', '--layout', 'dvorak']) == 0
    shown = capsys.readouterr().out
    assert ',/o forward, back   a/e left, right   h/n turn   c/t height' in shown
    assert 'then ,.' in shown


@pytest.mark.slow
def test_wasd_keys_says_what_is_wrong_in_one_line(capsys):
    assert main(['keys', 'wsad']) == 2
    assert capsys.readouterr().err.startswith("error: unknown preset 'wsad', did you mean wasd?")


def test_each_meaning_of_a_keymap_is_a_line():
    lines = describe_keymap('go2', 'qwerty')
    assert '  f            forward + left' in lines
    assert '  z            back + turn right' in lines
    assert '  u            speed +10 %' in lines
