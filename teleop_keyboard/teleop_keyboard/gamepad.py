# SPDX-License-Identifier: Apache-2.0
"""
What a gamepad says: its device's events as the state of sensor_msgs/Joy, as keys, as a velocity.

The sticks are a velocity command by the law of teleop_twist_joy:

    component = axes[axis] * scale      0 where the pad has no such axis, or it is -1
    scale     = scale_*_turbo while enable_turbo_button is down, else scale_* while enable_button
                is down (or is not required)
    yaw       = -yaw while reversing, with inverted_reverse

One zero follows when neither button is down any more, then nothing (teleop_twist_joy 2.6,
src/teleop_twist_joy.cpp: getVal, fillCmdVelMsg, joyCallback).
"""

from array import array
from collections.abc import Mapping, Sequence
import math
import struct
from typing import NamedTuple

from wasd_core.errors import suggest
from wasd_core.parameters import InvalidParameter, Parameters

from teleop_keyboard.parameters import JoyParameters

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


# Name -> its button and its axis, -1 where there is none. A trigger is an axis, a button or both.
Controls = Mapping[str, tuple[int, int]]
# As xpad numbers them, and hid-playstation all but the last four.
USUAL_CONTROLS: Controls = {
    'A': (0, -1),
    'B': (1, -1),
    'X': (2, -1),
    'Y': (3, -1),
    'L1': (4, -1),
    'R1': (5, -1),
    'L2': (-1, 2),
    'R2': (-1, 5),
    'SELECT': (6, -1),
    'START': (7, -1),
    'MODE': (8, -1),
}
# BTN_ and ABS_ codes of linux/input-event-codes.h.
BUTTON_CODES = {
    'A': 0x130,
    'B': 0x131,
    'X': 0x133,
    'Y': 0x134,
    'L1': 0x136,
    'R1': 0x137,
    'L2': 0x138,
    'R2': 0x139,
    'SELECT': 0x13A,
    'START': 0x13B,
    'MODE': 0x13C,
}
AXIS_CODES = {'L2': 0x02, 'R2': 0x05}
# An axis that goes from 1 at rest to -1 is down from here on.
PULLED = -0.5


def controls_of(axis_codes: Sequence[int], button_codes: Sequence[int]) -> Controls:
    """Return where each name is on a pad that says what its axes and buttons are."""

    def place(codes: Sequence[int], code: int | None) -> int:
        return codes.index(code) if code in codes else -1

    return {
        name: (place(button_codes, code), place(axis_codes, AXIS_CODES.get(name)))
        for name, code in BUTTON_CODES.items()
    }


class Binding(NamedTuple):
    """`key` is pressed by `button` while all of `held` are down."""

    held: frozenset[str]
    button: str
    key: str


def parse_binding(text: str) -> Binding:
    """
    Return what `L2+A=2` says: A presses the key 2 while L2 is down.

    Raises:
        InvalidParameter: it is not so written, or names a button that pads have not.
    """
    buttons, separator, key = text.partition('=')
    *held, last = buttons.split('+')
    if not separator or not key:
        raise InvalidParameter(f"keys: got {text!r}, wanted 'BUTTON=KEY' or 'BUTTON+BUTTON=KEY'")
    for name in (*held, last):
        if name not in BUTTON_CODES:
            raise InvalidParameter(f'keys: {text}: no button {name}{suggest(name, BUTTON_CODES)}')
    return Binding(frozenset(held), last, key)


class PadKeys:
    """
    The keys that the buttons of a pad press.

    `step` takes its state and returns the keys pressed since the last one; the first state after
    `reset` presses none. Of several bindings of a button that with most others held counts.
    """

    def __init__(self, bindings: Sequence[str], controls: Controls = USUAL_CONTROLS) -> None:
        self._bindings = [parse_binding(text) for text in bindings]
        self.controls = controls
        self.reset()

    def reset(self) -> None:
        """Know nothing of the buttons."""
        self._down: frozenset[str] | None = None

    def step(self, state: JoyState) -> list[str]:
        """Return the keys that are pressed with this state."""
        down = frozenset(n for n, (b, a) in self.controls.items() if _is_down(state, b, a))
        fresh = down - (down if self._down is None else self._down)
        self._down = down
        keys = []
        for button in sorted(fresh):
            fitting = [b for b in self._bindings if b.button == button and b.held <= down]
            if fitting:
                keys.append(max(fitting, key=lambda binding: len(binding.held)).key)
        return keys


def _is_down(state: JoyState, button: int, axis: int = -1) -> bool:
    is_pressed = 0 <= button < len(state.buttons) and bool(state.buttons[button])
    return is_pressed or (0 <= axis < len(state.axes) and state.axes[axis] <= PULLED)


class JoyTwist(NamedTuple):
    """A velocity in the robot's frame: forward, left, up [m/s], about the same axes [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wx: float = 0.0
    wy: float = 0.0
    wz: float = 0.0


class JoyToTwist:
    """
    The commands that follow from a sequence of states of a pad; `is_driving` while one enables it.

    `step` takes a state and returns the command to be published with it, or None. `lose` says that
    there is no pad any more, `disarm` that the robot was stopped: nothing drives until what
    enables the sticks was let go, or, where they need nothing, until they were at rest.
    """

    def __init__(self, parameters: JoyParameters) -> None:
        self.parameters = parameters
        self.reset()

    def reset(self) -> None:
        """Be as before the first state."""
        self._has_stopped = False
        self._awaits_release = False
        self.is_driving = False

    def step(self, state: JoyState) -> JoyTwist | None:
        """Take a state; a number that is not finite drives nothing."""
        settings = self.parameters
        turbo = settings.enable_turbo_button
        if turbo >= 0 and _is_down(state, turbo):
            linear: Parameters = settings.scale_linear_turbo
            angular: Parameters = settings.scale_angular_turbo
        elif not settings.require_enable_button or _is_down(state, settings.enable_button):
            linear, angular = settings.scale_linear, settings.scale_angular
        else:
            self._awaits_release = False
            return self.lose()
        velocity = self._velocity(state, linear, angular)
        if not all(map(math.isfinite, velocity)):
            return self.lose()
        if not settings.require_enable_button and not any(velocity):
            self._awaits_release = False
        if self._awaits_release:
            return self.lose()
        self._has_stopped = False
        self.is_driving = True
        return velocity

    def lose(self) -> JoyTwist | None:
        """Note that nothing enables the sticks: return the one zero that this calls for."""
        has_stopped, self._has_stopped = self._has_stopped, True
        self.is_driving = False
        return None if has_stopped else JoyTwist()

    def disarm(self) -> JoyTwist | None:
        """Ignore what is held until it is released; return a zero if it drove."""
        self._awaits_release = True
        return self.lose() if self.is_driving else None

    def _velocity(self, state: JoyState, linear: Parameters, angular: Parameters) -> JoyTwist:
        lines, turns = self.parameters.axis_linear, self.parameters.axis_angular
        vx, vy, vz = (_value(state, lines, linear, name) for name in ('x', 'y', 'z'))
        wx, wy, wz = (_value(state, turns, angular, name) for name in ('roll', 'pitch', 'yaw'))
        if self.parameters.inverted_reverse and vx < 0.0:
            wz = -wz
        return JoyTwist(vx, vy, vz, wx, wy, wz)


def _value(state: JoyState, axes: Parameters, scales: Parameters, name: str) -> float:
    axis: int = getattr(axes, name)
    scale: float = getattr(scales, name)
    return state.axes[axis] * scale if 0 <= axis < len(state.axes) else 0.0
