# SPDX-License-Identifier: Apache-2.0
"""Makes any velocity command one the robot can follow: clamp, ramp, watchdog, no NaN."""

import math
from typing import NamedTuple

import numpy as np
from robot_description.morphology.quadruped import GO2
from robot_description.morphology.quadruped import Scale
from wasd_core.timing import Watchdog

from quadruped_sim.parameters import CommandParameters


class VelocityLimits(NamedTuple):
    """Largest commanded speeds: forward, backward, sideways [m/s] and turning [rad/s]."""

    forward: float
    backward: float
    lateral: float
    yaw: float


# unitree_guide's, and what the controller is good for on the Go2.
GUIDE = VelocityLimits(0.4, 0.4, 0.3, 0.5)
SPORT = VelocityLimits(2.0, 1.5, 0.8, 2.0)


def velocity_limits(
    name: str, scale: Scale, agility: float = 1.0, turning: float = 1.0
) -> VelocityLimits:
    """
    Return the limits of a robot: `sport` grows with it, `guide` is the same for all.

    `agility` is the share of that which its legs are fast enough for, `turning` the share of that
    when it turns; no robot is asked for more than its `sport`.
    """
    speed, turn = agility * scale.of('m/s'), agility * turning * scale.of('1/s')
    sport = VelocityLimits(
        SPORT.forward * speed, SPORT.backward * speed, SPORT.lateral * speed, SPORT.yaw * turn
    )
    if name == 'sport':
        return sport
    return VelocityLimits(*map(min, GUIDE, sport))


class CommandFilter:
    """
    Turns (vx, vy, yaw rate) requests into a command that ramps within limits.

    State: the request, its age and the present command. One `step` ages the request and moves the
    command; a request older than `timeout` counts as zero.
    """

    def __init__(
        self,
        params: CommandParameters,
        scale: Scale = GO2,
        agility: float = 1.0,
        turning: float = 1.0,
    ) -> None:
        self._robot = scale, agility, turning
        self.refused = 0
        self._age = Watchdog(params.timeout)
        self._request = np.zeros(3)
        self.tune(params)
        self.reset()

    def tune(self, params: CommandParameters, agility: float | None = None) -> None:
        """Take other limits, ramps and time-out; they hold for the present request, too."""
        self._params = params
        if agility is not None:
            self._robot = self._robot[0], agility, self._robot[2]
        self.limits = velocity_limits(params.limits, *self._robot)
        self._age.timeout = params.timeout
        self._request = self._clamped(*self._request.tolist())

    def reset(self) -> None:
        """Rest, as if no request had ever come."""
        self._request = np.zeros(3)
        self.command = np.zeros(3)
        self.forget_request()

    def forget_request(self) -> None:
        """Be as if no request had ever come: the command ramps down to rest."""
        self._age.reset()
        self._is_new = False

    def pass_time(self, dt: float) -> None:
        """Let `dt` [s] pass in which nothing was controlled: the request alone gets older."""
        if not self._is_new:
            self._age.step(dt)

    @property
    def is_silent(self) -> bool:
        """Whether the watchdog holds the command at zero."""
        return not self._age.is_alive

    def request(self, vx: float, vy: float, yaw_rate: float) -> str | None:
        """Take a request, clamped; NaN or infinity is refused, which the returned text says."""
        if not (math.isfinite(vx) and math.isfinite(vy) and math.isfinite(yaw_rate)):
            self.refused += 1
            return f'velocity command refused: not finite: ({vx}, {vy}, {yaw_rate})'
        self._request = self._clamped(vx, vy, yaw_rate)
        self._age.hear()
        self._is_new = True
        return None

    def _clamped(self, vx: float, vy: float, yaw_rate: float) -> np.ndarray:
        """Return a velocity within the limits that leads along the same curve as far as it can."""
        limits = self.limits
        velocity = np.array(
            (
                min(max(vx, -limits.backward), limits.forward),
                min(max(vy, -limits.lateral), limits.lateral),
                min(max(yaw_rate, -limits.yaw), limits.yaw),
            )
        )
        inward = math.hypot(velocity[0], velocity[1]) * abs(float(velocity[2]))
        most = self._params.curve_acceleration
        return velocity if inward <= most else velocity * math.sqrt(most / inward)

    def step(self, dt: float) -> np.ndarray:
        """Command (3,) after `dt` [s]: toward the request, or toward rest when it is too old."""
        self.pass_time(dt)
        self._is_new = False
        target = np.zeros(3) if self.is_silent else self._request
        params = self._params
        most = dt * np.array(
            (params.forward_acceleration, params.lateral_acceleration, params.yaw_acceleration)
        )
        self.command = self.command + np.clip(target - self.command, -most, most)
        # On its way from one curve to another the yaw rate waits for the speed.
        speed = math.hypot(self.command[0], self.command[1])
        tightest = params.curve_acceleration / max(speed, 1e-9)
        self.command[2] = min(max(self.command[2], -tightest), tightest)
        return self.command
