# SPDX-License-Identifier: Apache-2.0
"""What a gamepad says: the events of its device as the state that sensor_msgs/Joy has."""

from array import array
import math
import struct
from typing import NamedTuple

# struct js_event of linux/joystick.h: time [ms], value, type, number of the axis or button.
EVENT = struct.Struct('=IhBB')
BUTTON, AXIS = 0x01, 0x02
# Set in the events with which the kernel tells the state at the opening, or after it lost some.
INIT = 0x80
FULL = 32767.0


class JoyState(NamedTuple):
    """Axes in [-1, 1], left and up positive, as numbers of 32 bits; buttons are 0 or 1."""

    axes: tuple[float, ...] = ()
    buttons: tuple[int, ...] = ()


class Pad:
    """
    The axes and buttons of a pad by what its device has told.

    Axes are scaled as the `joy` drivers do: what lies within the dead zone is 0, from there it
    grows to 1. Until an axis is moved it is 0: the kernel's first word on it may be of old.
    A button that is down when the pad comes counts from its next press on, so that nothing drives
    by being plugged in.
    """

    def __init__(self, deadzone: float = 0.05) -> None:
        self.deadzone = deadzone
        self.reset()

    def reset(self) -> None:
        """Know nothing: there is no pad."""
        self._axes = array('f')
        self._buttons: list[int] = []
        self._ghosts: set[int] = set()
        self._rest = b''

    @property
    def state(self) -> JoyState:
        """The state now."""
        return JoyState(tuple(self._axes), tuple(self._buttons))

    def let_go(self, axes: bool = True) -> None:
        """Count every button that is down as up until it was let go, `axes` as centred."""
        self._ghosts |= {number for number, is_down in enumerate(self._buttons) if is_down}
        self._buttons = [0] * len(self._buttons)
        if axes:
            self._axes = array('f', [0.0] * len(self._axes))

    def take(self, data: bytes) -> list[JoyState]:
        """
        Take events as they were read; return the states to be told.

        Each press and each release is one, so that none is lost; axes are told together.
        """
        data = self._rest + data
        whole = len(data) - len(data) % EVENT.size
        self._rest = data[whole:]
        told: list[JoyState] = []
        before = self.state
        for _, value, kind, number in EVENT.iter_unpack(data[:whole]):
            if kind & ~INIT == AXIS:
                self._move(number, value, is_first=bool(kind & INIT))
            elif kind & ~INIT == BUTTON and self._press(number, value, bool(kind & INIT)):
                told.append(self.state)
        if self.state != (told[-1] if told else before):
            told.append(self.state)
        return told

    def _move(self, number: int, value: int, is_first: bool) -> None:
        is_new = number >= len(self._axes)
        self._axes.extend([0.0] * (number + 1 - len(self._axes)))
        if not (is_first and is_new):
            zone = FULL * self.deadzone
            beyond = max(abs(value) - zone, 0.0) / (FULL - zone)
            # Theirs is right and down; -32768 is one more than full.
            self._axes[number] = -math.copysign(min(beyond, 1.0), value) if beyond else 0.0

    def _press(self, number: int, value: int, is_first: bool) -> bool:
        """Take a button's word; return whether its state has changed, or it is a new one."""
        is_new = number >= len(self._buttons)
        self._buttons += [0] * (number + 1 - len(self._buttons))
        if not value:
            self._ghosts.discard(number)
        elif is_first and not self._buttons[number]:
            self._ghosts.add(number)
        is_down = int(bool(value) and number not in self._ghosts)
        has_changed = self._buttons[number] != is_down
        self._buttons[number] = is_down
        return has_changed and not is_new
