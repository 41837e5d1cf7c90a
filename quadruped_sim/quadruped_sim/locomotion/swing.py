# SPDX-License-Identifier: Apache-2.0
"""The feet in the air: where they land, on which path, and what accelerations take them there."""

import math
from typing import NamedTuple

import numpy as np

from quadruped_sim.algebra import jit
from quadruped_sim.algebra import plain
from quadruped_sim.estimation.contacts import Ground
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import BaseMotion
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_model import RobotState


@jit
def minimum_jerk(s: float) -> tuple[float, float, float]:
    """Quintic from 0 to 1 over s in [0, 1], and two derivatives; it rests at both ends."""
    value = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    slope = 30.0 * s * s * (1.0 - s) ** 2
    curve = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    return value, slope, curve


@jit
def swing_point(
    start: np.ndarray, end: np.ndarray, height: float, phase: float, duration: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Foot on its way from `start` to `end`, both (3,) [m], at `phase` in [0, 1] of `duration` [s].

    Returns position [m], velocity [m/s] and acceleration [m/s^2], each (3,). The foot passes
    `height` [m] above the higher of the two ends at half time and lands at rest.
    """
    s = min(max(phase, 0.0), 1.0)
    rate = 1.0 / duration
    value, slope, curve = minimum_jerk(s)
    position, velocity, acceleration = np.empty(3), np.empty(3), np.empty(3)
    for k in range(2):
        travel = end[k] - start[k]
        position[k] = start[k] + value * travel
        velocity[k] = slope * rate * travel
        acceleration[k] = curve * rate * rate * travel

    low, high = start[2], end[2]
    top = max(low, high) + height
    if s < 0.5:
        value, slope, curve = minimum_jerk(2.0 * s)
        base, rise = low, top - low
    else:
        value, slope, curve = minimum_jerk(2.0 * s - 1.0)
        base, rise = top, high - top
    position[2] = base + value * rise
    velocity[2] = 2.0 * slope * rate * rise
    acceleration[2] = 4.0 * curve * rate * rate * rise
    return position, velocity, acceleration


class FootholdRule(NamedTuple):
    """Feet below their hips in the base's yaw frame, (4, 3) [m]; gain [s] and reach [m]."""

    nominal: np.ndarray
    velocity_gain: float
    reach: float


@jit
def find_footholds(
    rule: FootholdRule, base: BaseMotion, reference: BaseReference, schedule: GaitState
) -> np.ndarray:
    """
    Landing points of the feet in world axes, shape (4, 3) [m], without their height.

    The shift from the place below the hip is v T/2 + gain (v - command) [Raibert1986], limited to
    `reach`, with T the time of stance; the yaw motion to come until the middle of the stance turns
    the place with it.
    """
    rule = FootholdRule(*rule)
    base = BaseMotion(*base)
    reference = BaseReference(*reference)
    schedule = GaitState(*schedule)
    position, velocity, command = base.position, base.velocity, reference.velocity
    stance_time, gain, reach = schedule.stance_time, rule.velocity_gain, rule.reach
    feet = np.zeros((4, 3))
    x = 0.5 * stance_time * velocity[0] + gain * (velocity[0] - command[0])
    y = 0.5 * stance_time * velocity[1] + gain * (velocity[1] - command[1])
    length = math.sqrt(x * x + y * y)
    if length > reach:
        x *= reach / length
        y *= reach / length
    for leg in range(4):
        remaining = (1.0 - schedule.phase[leg]) * schedule.swing_time
        angle = base.rpy[2] + reference.yaw_rate * (remaining + 0.5 * stance_time)
        c, s = math.cos(angle), math.sin(angle)
        nx, ny = rule.nominal[leg, 0], rule.nominal[leg, 1]
        feet[leg, 0] = position[0] + remaining * velocity[0] + c * nx - s * ny + x
        feet[leg, 1] = position[1] + remaining * velocity[1] + s * nx + c * ny + y
    return feet


# On the Go2 landing aims this deep into the ground [m]: a foot arrives even if it is lower.
_PRESS = 0.005


class SwingTargets(NamedTuple):
    """
    Targets of the swing feet in world axes; rows of the feet in `is_stance` (4,) mean nothing.

    `position`, `velocity`, `acceleration` (4, 3); the acceleration holds the feedback already.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    is_stance: np.ndarray


class FootMotion(NamedTuple):
    """Position [m] and velocity [m/s] of the foot centres, each (4, 3), world axes."""

    position: np.ndarray
    velocity: np.ndarray


class SwingGains(NamedTuple):
    """Height of a step [m]; acceleration per error of position [1/s^2] and of velocity [1/s]."""

    height: float
    position: float
    velocity: float


class SwingLegs:
    """Leads the feet in the air to their footholds; keeps where they left the ground."""

    def __init__(self, model: RobotModel, params: LegControllerParameters) -> None:
        self._clearance = model.geometry.foot_radius - _PRESS * model.scale.of('m')
        self.nominal = model.geometry.hip.copy()
        self.nominal[:, 1] += model.geometry.offset
        self.nominal[:, 2] = 0.0
        self._lift_off = np.zeros((4, 3))
        self.tune(params)

    def tune(self, params: LegControllerParameters) -> None:
        """Take other gains and another height of steps."""
        gains, rule = params.whole_body, params.foothold
        self._rule = FootholdRule(self.nominal, rule.velocity_gain, rule.reach)
        self._gains = SwingGains(
            params.gait.step_height, gains.swing_position_gain, gains.swing_velocity_gain
        )

    def reset(self, feet: np.ndarray) -> None:
        """Take the present feet (4, 3), world, as lift-off points."""
        self._lift_off = feet.copy()

    def lift(self, legs: np.ndarray, feet: np.ndarray) -> None:
        """Note where the feet of the mask `legs` (4,) leave the ground."""
        self._lift_off[legs] = feet[legs]

    def landing(
        self, base: BaseMotion, schedule: GaitState, reference: BaseReference, ground: Ground
    ) -> np.ndarray:
        """Where the foot centres land on the ground's plane, (4, 3), world axes [m]."""
        feet = find_footholds(plain(self._rule), plain(base), plain(reference), plain(schedule))
        feet[:, 2] = ground.heights(feet) + self._clearance
        return feet

    def step(
        self,
        state: RobotState,
        schedule: GaitState,
        is_stance: np.ndarray,
        reference: BaseReference,
        ground: Ground,
    ) -> SwingTargets:
        """Targets of this tick."""
        landing = self.landing(state.base, schedule, reference, ground)
        feet = FootMotion(state.feet, foot_velocities(state))
        targets = _swing_targets(
            self._lift_off, landing, plain(schedule), is_stance, plain(feet), plain(self._gains)
        )
        return SwingTargets(*targets, is_stance)


def foot_velocities(state: RobotState) -> np.ndarray:
    """Velocity of the foot centres in world axes (4, 3) [m/s]."""
    x, y, z = state.base.omega.tolist()
    spin = np.array(((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)))
    relative = state.motion.velocity + state.motion.position @ spin
    return np.asarray(state.base.velocity + relative @ state.base.R.T)


@jit
def _swing_targets(
    lift_off: np.ndarray,
    landing: np.ndarray,
    schedule: GaitState,
    is_stance: np.ndarray,
    feet: FootMotion,
    gains: SwingGains,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    schedule = GaitState(*schedule)
    feet = FootMotion(*feet)
    gains = SwingGains(*gains)
    position = feet.position.copy()
    velocity = np.zeros((4, 3))
    acceleration = np.zeros((4, 3))
    for leg in range(4):
        if is_stance[leg]:
            continue
        phase = schedule.phase[leg]
        p, v, a = swing_point(
            lift_off[leg], landing[leg], gains.height, phase, schedule.swing_time
        )
        for k in range(3):
            position[leg, k], velocity[leg, k] = p[k], v[k]
            acceleration[leg, k] = (
                a[k]
                + gains.position * (p[k] - feet.position[leg, k])
                + gains.velocity * (v[k] - feet.velocity[leg, k])
            )
    return position, velocity, acceleration
