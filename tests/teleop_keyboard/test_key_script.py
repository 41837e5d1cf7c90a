# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.decoder import KeyDecoder
from teleop_keyboard.key_script import KeyPress, KeyScriptError, parse_key_script, script_word

from teleop_keyboard import key_script


def test_each_word_of_a_line_is_pressed_at_its_time():
    assert parse_key_script('0.5 i j\n2 k') == [(0.5, 'i'), (0.5, 'j'), (2.0, 'k')]


def test_a_star_repeats_a_key_at_30_hz():
    presses = parse_key_script('1 UP*3')
    assert [press.key for press in presses] == ['UP'] * 3
    assert [press.time for press in presses] == pytest.approx([1.0, 1.0 + 1 / 30, 1.0 + 2 / 30])


def test_comments_and_blank_lines_mean_nothing():
    assert parse_key_script('# a drive\n\n  1 i # forward\n\t\n') == [KeyPress(1.0, 'i')]
    assert parse_key_script('') == []


def test_presses_are_sorted_and_equal_times_keep_their_order():
    keys = [press.key for press in parse_key_script('3 a\n1 b c\n0 d\n1 e')]
    assert keys == ['d', 'b', 'c', 'e', 'a']


def test_characters_of_the_format_have_names():
    script = '0 SPACE STAR HASH STAR*2 SPACE*1 SHIFT+UP ,'
    keys = [press.key for press in parse_key_script(script)]
    assert sorted(keys) == sorted([' ', '*', '#', '*', '*', ' ', 'SHIFT+UP', ','])


def test_a_character_whose_capital_is_two_is_a_key_that_a_script_knows_with_any_modifier():
    several = [code for code in range(0x10000) if len(chr(code).upper()) > 1]
    assert ord('ß') in several
    for modifiers in range(1, 9):
        for code in several:
            (key,) = KeyDecoder().feed(f'\x1b[{code};{modifiers}u'.encode())
            assert [press.key for press in parse_key_script(f'0 {script_word(key)}')] == [key]


@for_all(
    ('line', 'message'),
    [
        ('x i', "got time 'x', wanted seconds >= 0"),
        ('-1 i', "got time '-1', wanted seconds >= 0"),
        ('nan i', "got time 'nan'"),
        ('inf i', "got time 'inf'"),
        ('1', 'got no key at 1 s'),
        ('1 # i', 'got no key at 1 s'),
        ('1 UPP', "unknown key 'UPP', did you mean UP?"),
        ('1 i*', "got 'i*', wanted key*N"),
        ('1 i*0', "got 'i*0', wanted key*N"),
        ('1 i*-3', "got 'i*-3', wanted key*N"),
        ('1 i*2.5', "got 'i*2.5', wanted key*N"),
        ('1 i*99999999999', 'wanted key*N with N from 1'),
        ('1 *', "wanted STAR for the key '*'"),
    ],
)
def test_an_error_names_file_and_line(line, message):
    with pytest.raises(KeyScriptError) as caught:
        parse_key_script(f'0 i\n\n{line}\n9 ?? \n', 'drive.keys')
    assert str(caught.value).startswith('drive.keys:3: ')
    assert message in str(caught.value)


@pytest.mark.slow
def test_a_line_of_two_million_words_is_refused_at_once():
    with pytest.raises(KeyScriptError, match='drive.keys:1: wanted at most 100000 keys in a line'):
        parse_key_script('0 ' + 'i ' * 2_000_000, 'drive.keys')


def test_more_keys_in_one_instant_than_a_keyboard_has_are_refused_in_any_shape(monkeypatch):
    monkeypatch.setattr(key_script, 'MOST_AT_ONCE', 1000)
    with pytest.raises(KeyScriptError, match='drive.keys: wanted at most 1000 presses at 2 s'):
        parse_key_script('2 i\n' * 1001, 'drive.keys')
    assert len(parse_key_script('2 i\n' * 1000)) == 1000


def test_a_script_has_an_end(monkeypatch):
    monkeypatch.setattr(key_script, 'MOST_PRESSES', 1000)
    with pytest.raises(KeyScriptError, match='drive.keys:2: wanted at most 1000 presses in a'):
        parse_key_script('0 i*1000\n1 i', 'drive.keys')
