# SPDX-License-Identifier: Apache-2.0
"""Which of several robots the keyboard drives."""

from teleop_keyboard.key_names import HELD
from teleop_keyboard.key_names import RELEASE
from teleop_keyboard.key_names import split_event

SWITCH_KEY = 'TAB'
SWITCH_LINE = f'{SWITCH_KEY} goes to the next robot'


class KeySwitch:
    """
    Sends each key to one of `count` robots: the one in turn, which SWITCH_KEY makes the next.

    A key that is still down at a switch belongs to the robot for which it was pressed until it is
    let go: its end must not reach the other one, and must reach this one.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._owners: dict[str, int] = {}
        self.active = 0

    def receiver(self, key: str) -> int | None:
        """Return which robot gets a key; None where the key was for the switch itself."""
        event, base = split_event(key)
        if self._count > 1 and base == SWITCH_KEY:
            if not event:
                self.active = (self.active + 1) % self._count
            return None
        if event == RELEASE:
            return self._owners.pop(base, self.active)
        if event == HELD:
            return self._owners.setdefault(base, self.active)
        return self.active
