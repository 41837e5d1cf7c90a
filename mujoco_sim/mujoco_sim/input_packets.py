# SPDX-License-Identifier: Apache-2.0
"""The packets that a browser sends to Studio's page: which keys are down, once per picture."""

from collections.abc import Iterator
import struct

# NetImgui's header: u32 size, u8 type, 3 bytes of nothing.
_HEADER = struct.Struct('<IB3x')
INPUT_TYPE = 2
# NetImgui 18's input: at 560 three u64, a bit for each key from ImGui's number 512 on.
INPUT_SIZE = 616
_KEYS = struct.Struct('<3Q')
_KEYS_AT = 560
FIRST_KEY = 512
# No packet of a browser is longer: the text of a clipboard.
LONGEST = 1 << 20


class UnknownPacket(ValueError):
    """A browser sends what Studio's own page would not."""


class InputPackets:
    """Takes what one browser sends, however it is cut, and gives the keys that are down."""

    def __init__(self) -> None:
        self._rest = b''

    def feed(self, data: bytes) -> Iterator[frozenset[int]]:
        """
        Yield, for each whole input packet, ImGui's numbers of the keys that are down.

        Raises:
            UnknownPacket: what came is no packet, or an input packet of another layout.
        """
        self._rest += data
        while len(self._rest) >= _HEADER.size:
            size, kind = _HEADER.unpack_from(self._rest)
            if not _HEADER.size <= size <= LONGEST:
                raise UnknownPacket(f'a packet of {size} bytes')
            if len(self._rest) < size:
                return
            packet, self._rest = self._rest[:size], self._rest[size:]
            if kind == INPUT_TYPE:
                yield keys_down(packet)


def keys_down(packet: bytes) -> frozenset[int]:
    """
    Return ImGui's numbers of the keys that are down in an input packet.

    Raises:
        UnknownPacket: it has another layout than that of the NetImgui that this reads.
    """
    if len(packet) != INPUT_SIZE:
        raise UnknownPacket(f'an input packet of {len(packet)} bytes, wanted {INPUT_SIZE}')
    down = []
    for word, bits in enumerate(_KEYS.unpack_from(packet, _KEYS_AT)):
        while bits:
            lowest = bits & -bits
            down.append(FIRST_KEY + 64 * word + lowest.bit_length() - 1)
            bits ^= lowest
    return frozenset(down)
