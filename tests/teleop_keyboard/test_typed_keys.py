# SPDX-License-Identifier: Apache-2.0
"""What a person types and holds is a key; what is pasted, or has queued up, is none."""

import random

from cases import for_all
import pytest
from teleop_keyboard.decoder import CharacterDecoder, KeyDecoder
from teleop_keyboard.typed_keys import PASTE_BEGIN, PASTE_END, PASTE_TIMEOUT, TypedKeys

# What one read of a terminal brings at most [bytes], and how often it is read [s].
READ = 4095
PERIOD = 0.01
MUCH = 100_000


def reads(data, size=READ):
    return [data[index : index + size] for index in range(0, len(data), size)]


def taken(typed, chunks, period=PERIOD):
    return [key for chunk in chunks for key in typed.take(chunk, period)]


@for_all('decoder', [KeyDecoder, CharacterDecoder])
@for_all('size', [100, 500, READ])
@pytest.mark.slow
def test_much_pasted_text_is_a_stop_and_no_key(decoder, size):
    assert taken(TypedKeys(decoder()), reads(b'i' * MUCH, size)) == ['STOP']


@for_all('rate', [400.0, 1000.0, 10_000.0])
def test_text_over_a_slow_line_is_stopped_before_0_3_s(rate):
    typed, count, now = TypedKeys(KeyDecoder()), 0.0, 0.0
    while 'STOP' not in typed.take(b'i' * (int(count + rate * PERIOD) - int(count)), PERIOD):
        count, now = count + rate * PERIOD, now + PERIOD
        assert now < 0.3
    assert taken(typed, [b'i' * int(rate * PERIOD)] * 1000) == []


@for_all('rate', [15.0, 30.0, 50.0, 90.0])
def test_a_key_that_is_held_is_never_taken_for_text(rate):
    typed = TypedKeys(KeyDecoder())
    counts = [
        int((index + 1) * rate * PERIOD) - int(index * rate * PERIOD) for index in range(3000)
    ]
    assert taken(typed, [b'i' * count for count in counts]) == ['i'] * sum(counts)


def test_repeats_that_a_stutter_of_a_second_delivers_together_are_keys():
    typed = TypedKeys(KeyDecoder())
    assert typed.take(b'i' * 33, 1.1) == ['i'] * 33
    assert typed.take(b'2', PERIOD) == ['2']


def test_keys_count_again_a_third_of_a_second_after_a_text():
    typed = TypedKeys(KeyDecoder())
    assert taken(typed, reads(b'w' * 9000)) == ['STOP']
    assert taken(typed, [b'w'] * 3) == []
    taken(typed, [b''] * 34)
    assert typed.take(b'w', PERIOD) == ['w']
    assert not typed.passes_over


def test_a_key_that_is_down_ends_with_the_text_that_follows():
    typed = TypedKeys(KeyDecoder())
    typed.take(b'\x1b[?0u\x1b[119u', PERIOD)
    assert typed.take(b'i' * READ, PERIOD) == ['RELEASE+w', 'STOP']
    # Nor does a sequence in the text put one down.
    typed.take(b'\x1b[105;1:2;105u' * 200, PERIOD)
    assert taken(typed, [b''] * 100) == []


def test_ctrl_c_comes_through_a_text_where_the_terminal_tells_it_as_a_key():
    typed = TypedKeys(KeyDecoder())
    typed.take(b'\x1b[?0u', PERIOD)
    keys = typed.take(b'i' * 500 + b'\x1b[99;5u' + b'i' * 500, PERIOD)
    assert keys[-2:] == ['STOP', 'CTRL+C']
    assert 'i' not in keys


@for_all('seed', range(20))
def test_a_marked_paste_is_no_key_however_the_bytes_are_cut(seed):
    rng = random.Random(seed)
    text = bytes(rng.choice(b'iwasd 0123456789\x1b[u~\n') for _ in range(rng.randrange(3000)))
    data = b'j' + PASTE_BEGIN + text.replace(b'\x1b[201~', b'') + PASTE_END + b'k\x1b[A'
    typed, keys = TypedKeys(KeyDecoder()), []
    while data:
        size = rng.choice([1, 2, 3, 7, 100, 2000])
        keys += typed.take(data[:size], 0.0 if size < 8 else PERIOD)
        data = data[size:]
    assert keys == ['j', 'k', 'UP']
    assert typed.texts == 1
    assert not typed.passes_over


def test_many_short_pastes_in_one_read_are_no_keys():
    data = (PASTE_BEGIN + b'i' + PASTE_END) * 5000 + b'k'
    assert TypedKeys(KeyDecoder()).take(data, PERIOD) == ['k']


def test_a_paste_whose_end_is_lost_ends_by_itself():
    typed = TypedKeys(KeyDecoder())
    assert typed.take(PASTE_BEGIN + b'iii', PERIOD) == []
    assert typed.passes_over
    assert typed.take(b' ', PERIOD) == []
    typed.take(b'', PASTE_TIMEOUT)
    assert typed.take(b' ', PERIOD) == [' ']
