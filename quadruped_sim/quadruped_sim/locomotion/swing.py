# SPDX-License-Identifier: Apache-2.0
"""The feet in the air: where they land, on which path, and what accelerations take them there."""

from dataclasses import dataclass
import math

import numpy as np

from quadruped_sim.algebra import jit
from quadruped_sim.estimation.contacts import Ground
from quadruped_sim.estimation.robot_state import RobotState
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.parameters import FootholdParameters
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import RobotModel


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


def nominal_feet(hip: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Feet below their hips in the base's yaw frame, shape (4, 3), z 0 [m]."""
    feet = hip.copy()
    feet[:, 1] += offset
    feet[:, 2] = 0.0
    return feet


def footholds(
    params: FootholdParameters,
    nominal: np.ndarray,
    position: np.ndarray,
    yaw: float,
    velocity: np.ndarray,
    command: np.ndarray,
    yaw_rate: float,
    remaining: np.ndarray,
    stance_time: float,
    ground: Ground,
    clearance: float,
) -> np.ndarray:
    """
    Landing points of the foot centres in world axes, shape (4, 3) [m].

    `nominal` (4, 3) are the feet in the yaw frame; `velocity` and `command` (3,) [m/s] the base's
    real and commanded velocity in world axes; `remaining` (4,) [s] the time to touchdown.
    `clearance` [m] is what they keep from the ground plane.
    The shift is v T/2 + gain (v - command), limited to `reach`; the yaw motion to come until
    the middle of the stance turns the nominal foot with it.
    """
    feet = _footholds(
        nominal,
        position,
        yaw,
        velocity,
        command,
        yaw_rate,
        remaining,
        stance_time,
        params.velocity_gain,
        params.reach,
    )
    feet[:, 2] = ground.heights(feet) + clearance
    return feet


@jit
def _footholds(
    nominal: np.ndarray,
    position: np.ndarray,
    yaw: float,
    velocity: np.ndarray,
    command: np.ndarray,
    yaw_rate: float,
    remaining: np.ndarray,
    stance_time: float,
    gain: float,
    reach: float,
) -> np.ndarray:
    """Landing points without height, shape (4, 3)."""
    feet = np.zeros((4, 3))
    x = 0.5 * stance_time * velocity[0] + gain * (velocity[0] - command[0])
    y = 0.5 * stance_time * velocity[1] + gain * (velocity[1] - command[1])
    length = math.sqrt(x * x + y * y)
    if length > reach:
        x *= reach / length
        y *= reach / length
    for leg in range(4):
        angle = yaw + yaw_rate * (remaining[leg] + 0.5 * stance_time)
        c, s = math.cos(angle), math.sin(angle)
        nx, ny = nominal[leg, 0], nominal[leg, 1]
        feet[leg, 0] = position[0] + remaining[leg] * velocity[0] + c * nx - s * ny + x
        feet[leg, 1] = position[1] + remaining[leg] * velocity[1] + s * nx + c * ny + y
    return feet


# On the Go2 landing aims this deep into the ground [m]: a foot arrives even if it is lower.
_PRESS = 0.005


@dataclass(frozen=True)
class SwingTargets:
    """
    Targets of the swing feet in world axes; rows of standing feet mean nothing.

    `position`, `velocity`, `acceleration` (4, 3); the acceleration holds the feedback already.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class SwingLegs:
    """Leads the feet in the air to their footholds; keeps where they left the ground."""

    def __init__(self, model: RobotModel, params: LegControllerParameters) -> None:
        self.params = params
        self._radius = model.geometry.foot_radius
        self._press = _PRESS * model.scale.of('m')
        self.nominal = nominal_feet(model.geometry.hip, model.geometry.offset)
        self._lift_off = np.zeros((4, 3))

    def reset(self, feet: np.ndarray) -> None:
        """Take the present feet (4, 3), world, as lift-off points."""
        self._lift_off = feet.copy()

    def lift(self, legs: np.ndarray, feet: np.ndarray) -> None:
        """Note where the feet of the mask `legs` (4,) leave the ground."""
        self._lift_off[legs] = feet[legs]

    def step(
        self,
        state: RobotState,
        schedule: GaitState,
        is_stance: np.ndarray,
        reference: BaseReference,
        ground: Ground,
    ) -> SwingTargets:
        """Targets of this tick."""
        params = self.params
        landing = footholds(
            params.foothold,
            self.nominal,
            state.base.position,
            float(state.base.rpy[2]),
            state.base.velocity,
            reference.velocity,
            reference.yaw_rate,
            (1.0 - schedule.phase) * schedule.swing_time,
            schedule.stance_time,
            ground,
            self._radius - self._press,
        )
        gains = params.whole_body
        return SwingTargets(
            *_swing_targets(
                self._lift_off,
                landing,
                params.gait.step_height,
                schedule.phase,
                schedule.swing_time,
                is_stance,
                state.feet,
                foot_velocities(state),
                gains.swing_position_gain,
                gains.swing_velocity_gain,
            )
        )


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
    height: float,
    phase: np.ndarray,
    swing_time: float,
    is_stance: np.ndarray,
    feet: np.ndarray,
    foot_velocity: np.ndarray,
    position_gain: float,
    velocity_gain: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    position = feet.copy()
    velocity = np.zeros((4, 3))
    acceleration = np.zeros((4, 3))
    for leg in range(4):
        if is_stance[leg]:
            continue
        p, v, a = swing_point(lift_off[leg], landing[leg], height, phase[leg], swing_time)
        for k in range(3):
            position[leg, k], velocity[leg, k] = p[k], v[k]
            acceleration[leg, k] = (
                a[k]
                + position_gain * (p[k] - feet[leg, k])
                + velocity_gain * (v[k] - foot_velocity[leg, k])
            )
    return position, velocity, acceleration
