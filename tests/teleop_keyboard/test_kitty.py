# SPDX-License-Identifier: Apache-2.0
"""Releases by kitty's keyboard protocol, with a test that plays the terminal."""

import os
import pty
import signal
import time

import pytest
from teleop_keyboard.decoder import KeyDecoder
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.terminal import ASK_KITTY, KITTY_OFF, KITTY_ON, Terminal
from terminals import PATIENCE

ANSWER = b'\x1b[?0u'


@pytest.fixture
def decoder():
    decoder = KeyDecoder()
    assert decoder.feed(ANSWER) == []
    assert decoder.speaks_kitty
    return decoder


@pytest.mark.parametrize(
    ('data', 'names'),
    [
        (b'\x1b[119;;119u\x1b[119;1:2;119u\x1b[119;1:3u', ['w', 'w', 'RELEASE+w']),
        (b'\x1b[A\x1b[1;1:2A\x1b[1;1:3A', ['UP', 'UP', 'RELEASE+UP']),
        (b'\x1b[3~\x1b[3;1:3~', ['DELETE', 'RELEASE+DELETE']),
        (b'\x1b[27u\x1b[27;1:3u', ['ESC', 'RELEASE+ESC']),
        (b'\x1b[32;;32u\x1b[32;1:3u', [' ', 'RELEASE+SPACE']),
        (b'\x1b[99;5u', ['CTRL+C']),
        # Shift let go before the key: the release has the name of the press.
        (b'\x1b[119;2;87u\x1b[119;1:3u', ['W', 'RELEASE+W']),
        # What Shift makes of a digit is in the text; Caps Lock (64) is no modifier of a name.
        (b'\x1b[49;2;33u', ['!']),
        (b'\x1b[119;65;119u', ['w']),
        (b'\x1b[57419u', ['UP']),
        # Shift alone is no key; nor is the end of a press that nobody saw.
        (b'\x1b[57441;2u\x1b[13;1:3u', []),
    ],
)
def test_presses_repeats_and_releases_are_named(decoder, data, names):
    assert decoder.feed(data) == names


def test_a_lost_focus_releases_every_key(decoder):
    decoder.feed(b'\x1b[119u\x1b[100u')
    assert decoder.down == ('w', 'd')
    assert decoder.feed(b'\x1b[O') == ['RELEASE+w', 'RELEASE+d']
    assert decoder.down == ()


def test_a_terminal_that_does_not_answer_tells_no_key_down():
    decoder = KeyDecoder()
    decoder.feed(b'\x1b[A')
    assert decoder.down == ()


@pytest.fixture
def screen():
    """Return a reader on a pseudo-terminal, and its other end."""
    master, slave = pty.openpty()
    with KeyReader(Terminal(slave)) as reader:
        yield reader, master
    os.close(master)
    os.close(slave)


def poll_until(reader, wanted):
    keys = []
    deadline = time.monotonic() + PATIENCE
    while not wanted(keys):
        assert time.monotonic() < deadline, keys
        keys += reader.poll(0.01)
    return keys


def shown(master, text):
    data = b''
    while text not in data:
        data += os.read(master, 1000)
    return data


@pytest.mark.slow
def test_a_reader_asks_once_and_then_tells_what_is_down(screen):
    reader, master = screen
    assert reader.poll(0.0) == []
    shown(master, ASK_KITTY)
    os.write(master, ANSWER)
    poll_until(reader, lambda _: reader.terminal.tells_releases)
    shown(master, KITTY_ON)
    os.write(master, b'\x1b[119u')
    keys = poll_until(reader, lambda keys: len(keys) >= 4)
    assert keys == ['w', 'HELD+w', 'HELD+w', 'HELD+w']
    os.write(master, b'\x1b[119;1:3u')
    keys = poll_until(reader, lambda keys: 'RELEASE+w' in keys)
    assert keys[-1] == 'RELEASE+w'
    assert reader.poll(0.2) == []
    reader.terminal.restore()
    shown(master, KITTY_OFF)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('code', 'number'), [(99, signal.SIGINT), (122, signal.SIGTSTP), (92, signal.SIGQUIT)]
)
def test_ctrl_keys_stay_signals(screen, monkeypatch, code, number):
    reader, master = screen
    sent = []
    monkeypatch.setattr(os, 'killpg', lambda group, number: sent.append((group, number)))
    os.write(master, ANSWER)
    poll_until(reader, lambda _: reader.terminal.tells_releases)
    os.write(master, b'\x1b[%d;5u' % code)
    poll_until(reader, lambda _: sent)
    assert sent == [(os.getpgrp(), number)]


def test_a_release_ends_a_motion_at_once_and_keys_count_together():
    logic = KeysToTwist(load_preset('mbot'))
    for name in ('i', 'HELD+i'):
        logic.press(name)
    logic.step(0.05)
    for name in ('j', 'HELD+j'):
        logic.press(name)
    # i has not repeated for long: that its release was not told is enough.
    for _ in range(10):
        logic.step(0.1)
        logic.press('HELD+i')
        logic.press('HELD+j')
    assert logic.target == (0.2, 0.0, 0.0, 1.0)
    logic.press('RELEASE+i')
    assert logic.target == (0.0, 0.0, 0.0, 1.0)
    logic.press('RELEASE+j')
    assert logic.target == (0.0, 0.0, 0.0, 0.0)


def test_a_key_whose_release_is_never_told_is_given_up():
    logic = KeysToTwist(load_preset('mbot'))
    logic.press('i')
    logic.press('HELD+i')
    logic.step(0.36)
    assert logic.target == (0.0, 0.0, 0.0, 0.0)
