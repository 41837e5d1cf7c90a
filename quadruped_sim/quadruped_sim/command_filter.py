# SPDX-License-Identifier: Apache-2.0
"""Makes any velocity command one the robot can follow: clamp, ramp, watchdog, no NaN."""

from dataclasses import dataclass
import math

import numpy as np
from robot_description.similarity import GO2
from robot_description.similarity import Scale

from quadruped_sim.parameters import CommandParameters


@dataclass(frozen=True)
class VelocityLimits:
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
    return VelocityLimits(
        min(GUIDE.forward, sport.forward),
        min(GUIDE.backward, sport.backward),
        min(GUIDE.lateral, sport.lateral),
        min(GUIDE.yaw, sport.yaw),
    )


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
        self._params = params
        self.limits = velocity_limits(params.limits, scale, agility, turning)
        self.refused = 0
        self.reset()

    def reset(self) -> None:
        """Rest, as if no request had ever come."""
        self._request = np.zeros(3)
        self._age = math.inf
        self.command = np.zeros(3)

    @property
    def is_silent(self) -> bool:
        """Whether the watchdog holds the command at zero."""
        return self._age > self._params.timeout

    def request(self, vx: float, vy: float, yaw_rate: float) -> str | None:
        """Take a request, clamped; NaN or infinity is refused, which the returned text says."""
        if not (math.isfinite(vx) and math.isfinite(vy) and math.isfinite(yaw_rate)):
            self.refused += 1
            return f'velocity command refused: not finite: ({vx}, {vy}, {yaw_rate})'
        limits = self.limits
        self._request = np.array(
            (
                min(max(vx, -limits.backward), limits.forward),
                min(max(vy, -limits.lateral), limits.lateral),
                min(max(yaw_rate, -limits.yaw), limits.yaw),
            )
        )
        self._age = 0.0
        return None

    def step(self, dt: float) -> np.ndarray:
        """Command (3,) after `dt` [s]: toward the request, or toward rest when it is too old."""
        target = np.zeros(3) if self.is_silent else self._request
        self._age += dt
        params = self._params
        most = dt * np.array(
            (params.forward_acceleration, params.lateral_acceleration, params.yaw_acceleration)
        )
        self.command = self.command + np.clip(target - self.command, -most, most)
        return self.command
