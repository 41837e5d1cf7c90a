# SPDX-License-Identifier: Apache-2.0
"""Two virtual joysticks moved by keys, as unitree_guide's keyboard panel has them."""

from dataclasses import dataclass

STEP = 0.05

# Key, lower case -> (stick axis, direction).
STICK_KEYS = {
    'w': ('ly', 1),
    's': ('ly', -1),
    'd': ('lx', 1),
    'a': ('lx', -1),
    'l': ('rx', 1),
    'j': ('rx', -1),
    'i': ('ry', 1),
    'k': ('ry', -1),
}
ZERO_KEY = ' '


@dataclass(frozen=True)
class StickValues:
    """Deflections in [-1, 1]: left and right stick, x to the right, y forward."""

    lx: float = 0.0
    ly: float = 0.0
    rx: float = 0.0
    ry: float = 0.0


class Sticks:
    """
    Keys step an axis by 0.05 and it stays there; space returns all to zero.

    Counts steps as integers, so that twenty up and twenty down is exactly zero.
    """

    def __init__(self) -> None:
        self.zero()

    def zero(self) -> None:
        """Centre both sticks."""
        self._counts = dict.fromkeys(('lx', 'ly', 'rx', 'ry'), 0)

    def press(self, key: str) -> bool:
        """Take a key, upper or lower case; False when it is no stick key."""
        if key in (ZERO_KEY, 'SPACE'):
            self.zero()
            return True
        if key.lower() not in STICK_KEYS or len(key) != 1:
            return False
        axis, direction = STICK_KEYS[key.lower()]
        full = round(1.0 / STEP)
        self._counts[axis] = min(max(self._counts[axis] + direction, -full), full)
        return True

    @property
    def values(self) -> StickValues:
        """Deflections now."""
        full = round(1.0 / STEP)
        return StickValues(**{axis: count / full for axis, count in self._counts.items()})
