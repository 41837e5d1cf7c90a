# SPDX-License-Identifier: Apache-2.0
import sys

from cases import for_all
import pytest
from teleop_keyboard.decoder import KeyDecoder

SEQUENCES = [
    (b'i', 'i'),
    (b' ', ' '),
    (b'\x1b[A', 'UP'),
    (b'\x1bOB', 'DOWN'),
    (b'\x1b[C', 'RIGHT'),
    (b'\x1bOD', 'LEFT'),
    (b'\x1b[H', 'HOME'),
    (b'\x1b[1~', 'HOME'),
    (b'\x1b[7~', 'HOME'),
    (b'\x1b[F', 'END'),
    (b'\x1b[4~', 'END'),
    (b'\x1b[2~', 'INSERT'),
    (b'\x1b[3~', 'DELETE'),
    (b'\x1b[5~', 'PGUP'),
    (b'\x1b[6~', 'PGDN'),
    (b'\x1bOP', 'F1'),
    (b'\x1b[11~', 'F1'),
    (b'\x1b[[A', 'F1'),
    (b'\x1b[[E', 'F5'),
    (b'\x1b[15~', 'F5'),
    (b'\x1b[21~', 'F10'),
    (b'\x1b[24~', 'F12'),
    (b'\x1b[1;2A', 'SHIFT+UP'),
    (b'\x1b[a', 'SHIFT+UP'),
    (b'\x1bOa', 'CTRL+UP'),
    (b'\x1b[1;5C', 'CTRL+RIGHT'),
    (b'\x1b[1;3D', 'ALT+LEFT'),
    (b'\x1b[1;8B', 'CTRL+ALT+SHIFT+DOWN'),
    (b'\x1b[3;5~', 'CTRL+DELETE'),
    (b'\x1b[1;2P', 'SHIFT+F1'),
    (b'\x1b[Z', 'SHIFT+TAB'),
    (b'\x1bOp', '0'),
    (b'\x1bO2p', '0'),
    (b'\x1bO5p', 'CTRL+0'),
    (b'\x1bOM', 'ENTER'),
    (b'\x1bx', 'ALT+x'),
    (b'\x1bX', 'ALT+X'),
    (b'\x1b ', 'ALT+SPACE'),
    (b'\x1b\xc3\xa9', 'ALT+é'),
    (b'\x1b\x01', 'CTRL+ALT+A'),
    (b'\x1b\x7f', 'ALT+BACKSPACE'),
    (b'\x01', 'CTRL+A'),
    (b'\x04', 'CTRL+D'),
    (b'\x1a', 'CTRL+Z'),
    (b'\x00', 'CTRL+SPACE'),
    (b'\t', 'TAB'),
    (b'\r', 'ENTER'),
    (b'\n', 'ENTER'),
    (b'\x7f', 'BACKSPACE'),
    (b'\x08', 'BACKSPACE'),
    ('é'.encode(), 'é'),
    ('ж'.encode(), 'ж'),
    ('中'.encode(), '中'),
    ('🙂'.encode(), '🙂'),
    (b'\x1b[97u', 'a'),
    (b'\x1b[97;5u', 'CTRL+A'),
    (b'\x1b[27u', 'ESC'),
]


@for_all(('data', 'key'), SEQUENCES)
def test_each_sequence_is_one_key(data, key):
    decoder = KeyDecoder()
    assert decoder.feed(data) == [key]
    assert not decoder.pending
    assert decoder.dropped == 0


@for_all(('data', 'key'), [pair for pair in SEQUENCES if len(pair[0]) > 1])
def test_a_sequence_cut_anywhere_is_still_one_key(data, key):
    for cut in range(1, len(data)):
        decoder = KeyDecoder()
        assert decoder.feed(data[:cut]) == []
        assert decoder.pending
        assert decoder.feed(data[cut:]) == [key]


def test_bytes_one_at_a_time_give_the_same_keys_as_one_burst():
    data = b''.join(data for data, _ in SEQUENCES)
    keys = [key for _, key in SEQUENCES]
    assert KeyDecoder().feed(data) == keys
    decoder = KeyDecoder()
    assert [key for byte in data for key in decoder.feed(bytes([byte]))] == keys


def test_ten_arrows_in_one_read_are_ten_keys():
    assert KeyDecoder().feed(b'\x1b[A' * 10) == ['UP'] * 10


def test_a_lone_escape_waits_for_the_flush():
    decoder = KeyDecoder()
    assert decoder.feed(b'\x1b') == []
    assert decoder.pending
    assert decoder.flush() == ['ESC']
    assert not decoder.pending
    assert decoder.flush() == []


def test_escape_before_another_sequence_is_not_lost():
    decoder = KeyDecoder()
    assert decoder.feed(b'\x1b\x1b[A') == ['ESC', 'UP']
    assert decoder.feed(b'\x1b\x1b') == ['ESC']
    assert decoder.flush() == ['ESC']


@for_all(('data', 'key'), [(b'\x1b[', 'ALT+['), (b'\x1bO', 'ALT+O')])
def test_an_introducer_alone_is_a_key_with_alt(data, key):
    decoder = KeyDecoder()
    assert decoder.feed(data) == []
    assert decoder.flush() == [key]


@for_all(
    'data',
    [
        b'\x1b[99z',  # a final letter that no key has
        b'\x1b[28~',  # a number that no key has
        b'\x1b[?1c',  # a terminal's reply
        b'\x1b[200~',  # bracketed paste
        b'\x1b[I',  # focus
        b'\x1b[<0;10;20M',  # mouse
        b'\xff',
        b'\xc3',  # the tail of a cut character follows as ASCII
        b'\xed\xa0\x80',  # a surrogate
        b'\xc2\x85',  # a control character
    ],
)
def test_unknown_bytes_are_dropped_and_the_next_key_is_read(data):
    decoder = KeyDecoder()
    assert decoder.feed(data + b'i') == ['i']
    assert decoder.dropped >= 1


def test_a_broken_character_is_dropped_by_the_flush():
    decoder = KeyDecoder()
    assert decoder.feed(b'\xe4\xb8') == []
    assert decoder.pending
    assert decoder.flush() == []
    assert decoder.dropped == 1
    assert decoder.feed(b'i') == ['i']


def test_a_broken_sequence_gives_way_to_what_breaks_it():
    decoder = KeyDecoder()
    assert decoder.feed(b'\x1b[1;\x1b[A') == ['UP']
    assert decoder.feed(b'\x1b[1\x03') == ['CTRL+C']
    assert decoder.dropped == 2


def test_an_endless_sequence_is_not_collected_for_ever():
    decoder = KeyDecoder()
    assert decoder.feed(b'\x1b[' + b'1' * 100_000) == []
    assert decoder.dropped == 1
    assert sys.getsizeof(decoder._buffer) < 200
    # Its end belongs to it, and where none comes the reader's flush ends it.
    assert decoder.feed(b'u') == []
    assert decoder.feed(b'i') == ['i']
    decoder.feed(b'\x1b[' + b'1' * 1000)
    assert decoder.pending
    assert decoder.flush() == []
    assert decoder.feed(b'i') == ['i']


@pytest.mark.slow
def test_any_bytes_whatever_leave_a_working_decoder():
    decoder = KeyDecoder()
    for first in range(256):
        for second in range(256):
            decoder.feed(b'\x1b' + bytes([first, second]))
            decoder.flush()
            assert decoder.feed(b'i') == ['i']
