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
ZERO_KEYS = (' ', 'SPACE')


def is_stick_key(key: str) -> bool:
    """Whether a key, upper or lower case, moves or centres the sticks."""
    return key in ZERO_KEYS or (len(key) == 1 and key.lower() in STICK_KEYS)


def axis_and_direction(key: str) -> tuple[str, int]:
    """Return what a stick's key, upper or lower case, moves: 'ly' and 1 for forward."""
    return STICK_KEYS[key.lower()]


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
        if not is_stick_key(key):
            return False
        if key in ZERO_KEYS:
            self.zero()
            return True
        axis, direction = axis_and_direction(key)
        full = round(1.0 / STEP)
        self._counts[axis] = min(max(self._counts[axis] + direction, -full), full)
        return True

    @property
    def values(self) -> StickValues:
        """Deflections now."""
        full = round(1.0 / STEP)
        return StickValues(**{axis: count / full for axis, count in self._counts.items()})
