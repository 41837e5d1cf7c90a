# SPDX-License-Identifier: Apache-2.0
"""From wheel speeds and encoder ticks to what the two motors get, by the mode's loop."""

import math
from typing import Protocol

from diff_drive_sim.arbotix_firmware import ArbotixFirmware
from diff_drive_sim.arbotix_firmware import FULL_PWM
from diff_drive_sim.arbotix_host import setpoints_of
from diff_drive_sim.controller import Controller
from diff_drive_sim.legacy_controller import LegacyController
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.wheel_loop import Gains
from diff_drive_sim.wheel_loop import WheelLoop
from diff_drive_sim.wheel_motor import WheelMotor

Pair = tuple[float, float]
Ticks = tuple[int, int]


class WheelDrive(Protocol):
    """The loops of both wheels."""

    def step(self, speeds: Pair, ticks: Ticks, dt: float) -> Pair:
        """Return duties, -1 to 1, for forward wheel speeds [rad/s]; `dt` [s] after the last."""

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""

    def reset(self) -> None:
        """Forget the past."""


class FloatDrive:
    """Two loops that know fractions."""

    def __init__(self, gains: Gains, motor: WheelMotor, scale: float, delay: int) -> None:
        self._loops = (
            WheelLoop(gains, motor, scale, delay),
            WheelLoop(gains, motor, scale, delay),
        )

    def step(self, speeds: Pair, ticks: Ticks, dt: float) -> Pair:
        """Return duties, -1 to 1, for forward wheel speeds [rad/s]; `dt` [s] after the last."""
        left, right = self._loops
        return left.step(speeds[0], ticks[0], dt), right.step(speeds[1], ticks[1], dt)

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""
        for loop in self._loops:
            loop.gains = gains

    def reset(self) -> None:
        """Forget the past."""
        for loop in self._loops:
            loop.reset()


class ArbotixDrive:
    """
    The board: its firmware, fed with what arbotix_driver sends.

    That are set-points made from the controller's velocity, or with `legacy` its host's own.
    """

    def __init__(self, gains: Gains, controller: Controller) -> None:
        self._controller = controller
        self._firmware = ArbotixFirmware(gains)
        self.reset()

    def step(self, speeds: Pair, ticks: Ticks, dt: float) -> Pair:
        """Return duties, -1 to 1; `speeds` are implied by the controller's velocity."""
        self._time += dt
        left, right = self._setpoints()
        self._firmware.write(left, right, *ticks)
        self._firmware.update(math.floor(1e3 * self._time + 1e-6), *ticks)
        pwm = self._firmware.pwm
        return pwm[0] / FULL_PWM, pwm[1] / FULL_PWM

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""
        self._firmware.setup(gains)

    def reset(self) -> None:
        """Be as after power-on."""
        self._time = 0.0
        self._firmware.reset()

    def _setpoints(self) -> Ticks:
        controller = self._controller
        if isinstance(controller, LegacyController):
            return controller.host.setpoints
        return setpoints_of(
            *controller.velocity,
            controller.geometry.wheel_separation,
            controller.parameters.ticks_meter,
        )


def gains_of(parameters: DiffDriveParameters) -> Gains:
    """Return the loop's gains."""
    return Gains(parameters.Kp, parameters.Kd, parameters.Ki, parameters.Ko)
