# SPDX-License-Identifier: Apache-2.0
"""
The checksum of LowCmd and LowState.

It is CRC-32/MPEG-2 over the words of the C struct, each from its highest bit on, without the
last, which holds it. zlib has the mirrored one: mirrored bytes in, a mirrored register out.
"""

import zlib

import numpy as np

from unitree_bridge.cdr import Layout

_MIRRORED = bytes(int(f'{byte:08b}'[::-1], 2) for byte in range(256))
_WORD = 4


class Checksum:
    """Of messages of one layout."""

    def __init__(self, layout: Layout) -> None:
        words = layout.struct_bytes().reshape(-1, _WORD)
        # Of each word the highest byte first.
        self._order = np.ascontiguousarray(words[:-1, ::-1]).ravel()
        self._place = int(layout.places_of('crc')[0])

    def of(self, raw: bytes | bytearray) -> int:
        """Return the checksum that a message ought to have."""
        taken = np.frombuffer(raw, np.uint8)[self._order].tobytes().translate(_MIRRORED)
        mirrored = zlib.crc32(taken) ^ 0xFFFFFFFF
        return int.from_bytes(mirrored.to_bytes(_WORD, 'little').translate(_MIRRORED), 'big')

    def in_message(self, raw: bytes | bytearray) -> int:
        """Return the checksum that a message has."""
        return int.from_bytes(raw[self._place : self._place + _WORD], 'little')

    def seal(self, raw: bytearray) -> None:
        """Write a message's checksum into it."""
        raw[self._place : self._place + _WORD] = self.of(raw).to_bytes(_WORD, 'little')
