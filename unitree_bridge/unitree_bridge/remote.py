# SPDX-License-Identifier: Apache-2.0
"""Unitree's remote control: its sticks and buttons, as messages and as what they ask for."""

import math
import struct
from typing import NamedTuple

from wasd_core.errors import InvalidMessage

from unitree_bridge.cdr import decode, encode
from unitree_bridge.shapes import WIRELESS_CONTROLLER

# The bits of `keys`, the lowest first.
BUTTONS = (
    *('R1', 'L1', 'START', 'SELECT', 'R2', 'L2', 'F1', 'F2'),
    *('A', 'B', 'X', 'Y', 'UP', 'RIGHT', 'DOWN', 'LEFT'),
)
_BITS = {name: 1 << bit for bit, name in enumerate(BUTTONS)}
# In LowState: a head, the buttons, then lx, rx, ry, L2, ly.
_IN_LOW_STATE = struct.Struct('<2sH5f16x')
_HEAD = b'\x55\x51'


class Remote(NamedTuple):
    """Sticks in [-1, 1], x to the right and y forward, and the buttons that are down."""

    lx: float = 0.0
    ly: float = 0.0
    rx: float = 0.0
    ry: float = 0.0
    down: frozenset[str] = frozenset()

    @property
    def keys(self) -> int:
        """The buttons as bits."""
        return sum(_BITS[name] for name in self.down)

    @property
    def is_centred(self) -> bool:
        """Whether no stick is deflected that drives."""
        return self.lx == self.ly == self.rx == 0.0

    def message(self) -> bytes:
        """Return it as a WirelessController."""
        values = {'lx': self.lx, 'ly': self.ly, 'rx': self.rx, 'ry': self.ry, 'keys': self.keys}
        return encode(WIRELESS_CONTROLLER, values)

    def in_low_state(self) -> bytes:
        """Return it as LowState's `wireless_remote` (40)."""
        sticks = self.lx, self.rx, self.ry, float('L2' in self.down), self.ly
        return _IN_LOW_STATE.pack(_HEAD, self.keys, *sticks)


def read_remote(raw: bytes) -> Remote:
    """
    Return what a WirelessController says; sticks beyond their ends are at them.

    Raises:
        InvalidMessage: it is none, or a stick is not finite.
    """
    said = decode(WIRELESS_CONTROLLER, raw)
    keys = said.pop('keys')
    if not all(map(math.isfinite, said.values())):
        raise InvalidMessage(f'a stick is not finite: {said}')
    sticks = {name: min(max(value, -1.0), 1.0) for name, value in said.items()}
    down = frozenset(name for bit, name in enumerate(BUTTONS) if keys >> bit & 1)
    return Remote(**sticks, down=down)
