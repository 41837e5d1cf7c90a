# SPDX-License-Identifier: Apache-2.0
"""Any bytes whatever: no exception, and the same keys however they are cut."""

import random

from cases import for_all
import pytest
from teleop_keyboard.decoder import KeyDecoder

MANY = 200_000
FINALS = [chr(code) for code in range(0x40, 0x7F)]
INTRODUCERS = ('\x1b[', '\x1b[', '\x1b[', '\x1bO', '\x1b[?', '\x1b[<', '\x1b[[', '\x1b')


def decode(data, cuts):
    """Return the keys of bytes that come in pieces."""
    decoder = KeyDecoder()
    keys, start = [], 0
    for end in [*cuts, len(data)]:
        keys += decoder.feed(data[start:end])
        start = end
    return keys + decoder.flush(), decoder.dropped


def cuts_of(data, rng, mean):
    cuts, at = [], 0
    while (at := at + rng.randint(1, 2 * mean)) < len(data):
        cuts.append(at)
    return cuts


def sequence(rng):
    """Return a sequence as the grammar of terminals has it, with numbers of up to 20 digits."""
    fields = []
    for _ in range(rng.randint(0, 4)):
        parts = []
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            digits = rng.choice((0, 1, 2, 3, 5, 7, 20))
            parts.append(''.join(rng.choice('0123456789') for _ in range(digits)))
        fields.append(':'.join(parts))
    return rng.choice(INTRODUCERS) + ';'.join(fields) + rng.choice(FINALS)


@for_all(
    'data',
    [
        b'\x1b[97;1;9999999u',
        b'\x1b[97;1;1114112u',
        b'\x1b[97;1;55296u',
        b'\x1b[97;1;97:99999999999999999999u',
        b'\x1b[99999999999999999999u',
        b'\x1b[' + b'9' * 5000 + b'u',
        b'\x1b[1;' + b'9' * 20 + b':3A',
    ],
)
def test_a_number_that_no_key_has_is_no_error(data):
    decoder = KeyDecoder()
    assert set(decoder.feed(data)) <= {'a'}
    assert decoder.feed(b'i') == ['i']


@pytest.mark.slow
def test_many_random_bytes_give_the_same_keys_however_they_are_cut():
    rng = random.Random(1)
    data = rng.randbytes(MANY)
    whole = decode(data, [])
    assert len(whole[0]) > MANY / 4
    assert decode(data, cuts_of(data, rng, 5)) == whole


@pytest.mark.slow
def test_many_sequences_give_the_same_keys_however_they_are_cut():
    rng = random.Random(2)
    pieces, size = [], 0
    while size < MANY:
        pieces.append(sequence(rng))
        size += len(pieces[-1])
    data = ''.join(pieces).encode()
    whole = decode(data, [])
    assert decode(data, cuts_of(data, rng, 5)) == whole


@for_all('final', FINALS)
def test_every_final_letter_takes_every_number(final):
    for number in ('', '0', '1', '13', '27', '57399', '1114111', '1114112', '9' * 20):
        for introducer in INTRODUCERS:
            data = f'{introducer}{number};{number};{number}{final}'.encode()
            decoder = KeyDecoder()
            decoder.feed(data)
            decoder.flush()
            assert decoder.feed(b'i') == ['i']


def test_noise_does_not_make_it_note_more_and_more_keys():
    decoder = KeyDecoder()
    decoder.feed(b'\x1b[?0u')
    for code in range(1000):
        decoder.feed(f'\x1b[{0x4E00 + code}u'.encode())
    assert len(decoder.down) <= 64
