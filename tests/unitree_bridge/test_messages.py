# SPDX-License-Identifier: Apache-2.0
"""Messages are byte for byte those of the SDK, whose own classes wrote the files in golden/."""

import json
import random
import struct

from cases import for_all
import numpy as np
import pytest
from unitree_bridge.cdr import decode, encode, Layout
from unitree_bridge.crc import Checksum
from unitree_bridge.remote import read_remote, Remote
from unitree_rig import GOLDEN
from wasd_core.errors import InvalidMessage

from unitree_bridge import shapes

SIZES = {
    'low_cmd': 812,
    'low_state': 1180,
    'sport_mode_state': 516,
    'wireless_controller': 22,
    'request': 76,
    'response': 51,
}


def golden(name):
    """Return a message as the SDK writes it, and its values."""
    values = json.loads((GOLDEN / f'{name}.json').read_text())
    return (GOLDEN / f'{name}.cdr').read_bytes(), values


@for_all('name', SIZES)
def test_a_message_is_the_sdk_s_byte_for_byte(name):
    raw, values = golden(name)
    assert encode(getattr(shapes, name.upper()), values) == raw
    assert len(raw) == SIZES[name]


@for_all('name', SIZES)
def test_what_is_read_is_written_the_same(name):
    shape, (raw, _) = getattr(shapes, name.upper()), golden(name)
    assert encode(shape, decode(shape, raw)) == raw


def test_a_height_map_is_laid_out_as_its_idl_says():
    # double stamp; string frame_id; float resolution; unsigned long width, height; ...
    data = np.arange(6, dtype='<f4')
    values = {'stamp': 1.25, 'frame_id': 'odom', 'resolution': 0.04, 'width': 3, 'height': 2}
    raw = encode(shapes.HEIGHT_MAP, {**values, 'origin': (-0.5, 2.0), 'data': data})
    head = struct.pack('<dI5s3xfIIffI', 1.25, 5, b'odom\0', 0.04, 3, 2, -0.5, 2.0, 6)
    assert raw == b'\x00\x01\x00\x00' + head + data.tobytes()


@for_all('name', ['low_cmd', 'low_state'])
def test_the_checksum_is_the_sdk_s(name):
    raw, values = golden(name)
    checksum = Checksum(Layout(getattr(shapes, name.upper())))
    assert checksum.of(raw) == checksum.in_message(raw) == values['crc']


def by_hand(words):
    """Return CRC-32/MPEG-2 of words as its definition has it, bit by bit."""
    register = 0xFFFFFFFF
    for word in words:
        for bit in range(31, -1, -1):
            out = register >> 31 ^ word >> bit & 1
            register = (register << 1 & 0xFFFFFFFF) ^ (0x04C11DB7 if out else 0)
    return register


def test_the_checksum_is_that_of_its_definition():
    layout = Layout(shapes.LOW_CMD)
    raw = bytearray(encode(shapes.LOW_CMD, {}))
    raw[4:] = random.Random(3).randbytes(len(raw) - 4)
    struct = np.frombuffer(raw, np.uint8)[layout.struct_bytes()]
    words = struct.view('<u4').tolist()
    assert Checksum(layout).of(raw) == by_hand(words[:-1])


@for_all('bit', [0, 8 * 300, 8 * 700 + 5])
def test_one_wrong_bit_changes_the_checksum(bit):
    raw, _ = golden('low_cmd')
    changed = bytearray(raw)
    changed[30 + bit // 8] ^= 1 << bit % 8
    checksum = Checksum(Layout(shapes.LOW_CMD))
    assert checksum.of(changed) != checksum.of(raw)


def test_padding_is_no_part_of_the_checksum():
    raw, _ = golden('low_cmd')
    layout = Layout(shapes.LOW_CMD)
    padding = set(range(4, len(raw))) - set(layout.struct_bytes().tolist())
    changed = bytearray(raw)
    for place in padding:
        changed[place] = 0xAA
    assert padding
    assert Checksum(layout).of(changed) == Checksum(layout).of(raw)


@for_all('name', ['low_cmd', 'low_state', 'sport_mode_state'])
def test_numbers_are_where_the_layout_says(name):
    shape, (raw, values) = getattr(shapes, name.upper()), golden(name)
    layout = Layout(shape)
    part = {'low_cmd': 'motor_cmd', 'low_state': 'motor_state', 'sport_mode_state': 'path_point'}
    field = {'sport_mode_state': 'vx'}.get(name, 'dq')
    wanted = [each[field] for each in values[part[name]]]
    assert layout.field(f'{part[name]}.{field}').of(raw).tolist() == wanted
    assert layout.size == SIZES[name]


@for_all('name', SIZES)
def test_half_messages_and_other_encodings_are_refused_in_words(name):
    shape, (raw, _) = getattr(shapes, name.upper()), golden(name)
    for size in range(len(raw) - 1):
        with pytest.raises(InvalidMessage):
            decode(shape, raw[:size])
    with pytest.raises(InvalidMessage, match='encoding: got 0000, wanted 0001'):
        decode(shape, b'\x00\x00' + raw[2:])


@for_all('name', ['request', 'response'])
def test_a_length_beyond_the_message_makes_no_room_for_it(name):
    raw, _ = golden(name)
    longest = raw[:-8] + b'\xff' * 8
    with pytest.raises(InvalidMessage):
        decode(getattr(shapes, name.upper()), longest)


@for_all('seed', range(3))
def test_anything_is_a_message_or_refused(seed):
    rng = random.Random(seed)
    for name in SIZES:
        raw, _ = golden(name)
        for _ in range(100):
            wrong = bytearray(raw[: rng.randrange(len(raw) + 1)] + rng.randbytes(rng.randrange(9)))
            for _ in range(rng.randrange(1, 9)):
                if wrong:
                    wrong[rng.randrange(len(wrong))] = rng.randrange(256)
            try:
                decode(getattr(shapes, name.upper()), bytes(wrong))
            except InvalidMessage as error:
                assert '\n' not in str(error)


def test_the_remote_is_told_as_it_was_heard():
    remote = Remote(0.25, -0.5, 1.0, -1.0, frozenset({'L2', 'A', 'START'}))
    assert read_remote(remote.message()) == remote
    assert remote.keys == 0b0000_0001_0010_0100


def test_the_remote_in_low_state_is_where_the_sdk_reads_it():
    # Its Joystick.extract: buttons in bytes 2 and 3, floats lx 4, rx 8, ry 12, ly 20.
    raw = Remote(0.25, -0.5, 0.75, -1.0, frozenset({'R1', 'LEFT'})).in_low_state()
    assert len(raw) == 40
    assert (raw[2], raw[3]) == (0b0000_0001, 0b1000_0000)
    numbers = np.frombuffer(raw, '<f4')
    assert numbers[[1, 2, 3, 5]].tolist() == [0.25, 0.75, -1.0, -0.5]


def test_a_stick_that_is_no_number_is_refused():
    raw = Remote(lx=float('nan')).message()
    with pytest.raises(InvalidMessage, match='not finite'):
        read_remote(raw)
