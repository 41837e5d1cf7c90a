# SPDX-License-Identifier: Apache-2.0
"""
The sticks of a gamepad as a velocity command, by the law of teleop_twist_joy.

    component = axes[axis] * scale      0 where the pad has no such axis, or it is -1
    scale     = scale_*_turbo while enable_turbo_button is down, else scale_* while enable_button
                is down (or is not required)
    yaw       = -yaw while reversing, with inverted_reverse

One zero follows when neither button is down any more, then nothing (teleop_twist_joy 2.6,
src/teleop_twist_joy.cpp: getVal, fillCmdVelMsg, joyCallback).
"""

import math
from typing import NamedTuple

from wasd_core.parameters import Parameters

from teleop_keyboard.gamepad import JoyState
from teleop_keyboard.pad_parameters import JoyParameters


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
    there is no pad any more, `hold` that the robot was stopped: nothing drives until what enables
    the sticks was let go, or, where they need nothing, until they were at rest.
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

    def hold(self) -> JoyTwist | None:
        """Count what is held as let go until it was; return a zero if it drove."""
        self._awaits_release = True
        return self.lose() if self.is_driving else None

    def _velocity(self, state: JoyState, linear: Parameters, angular: Parameters) -> JoyTwist:
        lines, turns = self.parameters.axis_linear, self.parameters.axis_angular
        vx, vy, vz = (_value(state, lines, linear, name) for name in ('x', 'y', 'z'))
        wx, wy, wz = (_value(state, turns, angular, name) for name in ('roll', 'pitch', 'yaw'))
        if self.parameters.inverted_reverse and vx < 0.0:
            wz = -wz
        return JoyTwist(vx, vy, vz, wx, wy, wz)


def _is_down(state: JoyState, button: int) -> bool:
    return 0 <= button < len(state.buttons) and bool(state.buttons[button])


def _value(state: JoyState, axes: Parameters, scales: Parameters, name: str) -> float:
    axis: int = getattr(axes, name)
    scale: float = getattr(scales, name)
    return state.axes[axis] * scale if 0 <= axis < len(state.axes) else 0.0
