# SPDX-License-Identifier: Apache-2.0
"""The feet in the air: where they left, where they go, what accelerations take them there."""

from dataclasses import dataclass

import numpy as np

from quadruped_sim.footholds import footholds
from quadruped_sim.footholds import nominal_feet
from quadruped_sim.gait import GaitState
from quadruped_sim.ground import Ground
from quadruped_sim.jit import jit
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.reference import BaseReference
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.swing import swing_point

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
            state.position,
            float(state.rpy[2]),
            state.velocity,
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
    x, y, z = state.omega.tolist()
    spin = np.array(((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)))
    relative = state.motion.velocity + state.motion.position @ spin
    return np.asarray(state.velocity + relative @ state.R.T)


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
