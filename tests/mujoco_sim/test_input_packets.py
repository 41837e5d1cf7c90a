# SPDX-License-Identifier: Apache-2.0
"""What a browser sends is read however it is cut, and what it would not send is refused."""

import random
import struct

from cases import for_all
from mujoco_sim.viewer.clicks import Mouse
from mujoco_sim.viewer.server import (
    InputPackets,
    keys_down,
    text_of,
    UnknownPacket,
    with_mouse,
    with_stroke,
)
from mujoco_sim.viewer.strokes import Stroke
from page_puppet import input_packet, VERSION_PACKET
import pytest


def test_keys_are_read_however_the_stream_is_cut():
    chance = random.Random(1)
    sets = [frozenset(chance.sample(range(512, 690), chance.randrange(5))) for _ in range(200)]
    stream = VERSION_PACKET + b''.join(input_packet(set(keys)) for keys in sets)
    packets, read = InputPackets(), []
    while stream:
        cut = chance.randrange(1, 900)
        read += packets.feed(stream[:cut])
        stream = stream[cut:]
    assert [pressed[0] for _, pressed in read if pressed is not None] == sets


def test_what_is_passed_on_is_what_came_but_for_the_mouse():
    chance = random.Random(3)
    told = [
        (chance.randrange(32), (chance.randrange(-9, 900), chance.randrange(-9, 600)))
        for _ in range(100)
    ]
    text = struct.pack('<IB3x', 13, 6) + b'words'
    stream = VERSION_PACKET + text.join(input_packet({520}, place, b) for b, place in told)
    whole, packets, passed = stream, InputPackets(), b''
    while stream:
        cut = chance.randrange(1, 900)
        for packet, pressed in packets.feed(stream[:cut]):
            passed += packet if pressed is None else with_mouse(packet, pressed[1])
        stream = stream[cut:]
    assert passed + packets.rest == whole
    assert with_mouse(input_packet({520}, (3, 4), 1), Mouse(2, (-5, 6))) == input_packet(
        {520}, (-5, 6), 2
    )


@for_all('text', ['', '1.25', '\U0001f600', 'x' * 256])
def test_a_packet_takes_another_stroke_and_nothing_else_of_it_changes(text):
    keys = frozenset({512, 600, 703})
    told = input_packet({520}, (3, 4), 1, text='ab')
    packet = with_stroke(told, Stroke(keys, text))
    assert (keys_down(packet), text_of(packet)) == (keys, text)
    # What a longer text leaves behind its end is read by nobody.
    back = with_stroke(packet, Stroke(frozenset({520}), 'ab' + '\0' * 254))
    assert with_stroke(back, Stroke(frozenset({520}), 'ab')) == told


@for_all('size', [0, 7, 2**20 + 1, 2**32 - 1])
def test_a_packet_of_an_impossible_size_is_refused(size):
    with pytest.raises(UnknownPacket, match=str(size)):
        list(InputPackets().feed(struct.pack('<IB3x', size, 2)))


@for_all('size', [8, 615, 617])
def test_input_of_another_layout_is_refused(size):
    with pytest.raises(UnknownPacket, match='616'):
        list(InputPackets().feed(struct.pack('<IB3x', size, 2) + bytes(size - 8)))


def test_random_bytes_are_read_or_refused():
    chance = random.Random(2)
    for _ in range(2000):
        packets = InputPackets()
        try:
            for _ in range(5):
                list(packets.feed(chance.randbytes(chance.randrange(2000))))
        except UnknownPacket:
            pass
