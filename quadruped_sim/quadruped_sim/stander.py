# SPDX-License-Identifier: Apache-2.0
"""Keeps the base at a pose on some feet while the others are led through the air."""

import numpy as np

from quadruped_sim.balance import base_acceleration
from quadruped_sim.balance import standing_forces
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.records import LegCommand
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.whole_body import WholeBody
from quadruped_sim.whole_body import WholeBodyTask

# On the Go2: acceleration of a led foot per position error [1/s^2] and per velocity [1/s],
_FOOT_GAINS = (300.0, 30.0)
# and motor-side damping [N m s/rad].
_DAMPING = 0.5


def stand_command(
    whole_body: WholeBody,
    model: RobotModel,
    params: LegControllerParameters,
    robot: RobotState,
    position: np.ndarray,
    rpy: np.ndarray,
    is_stance: np.ndarray,
    feet: np.ndarray,
) -> LegCommand:
    """
    Command that holds the base at `position`, `rpy` on the feet of `is_stance` (4,).

    The other feet are led to `feet` (4, 3), world [m]. Level ground is taken.
    """
    acceleration = base_acceleration(params.balance, robot, position, rpy)
    velocity = robot.velocity + (
        robot.motion.velocity @ robot.R.T
        + np.cross(robot.R @ robot.omega, robot.motion.position @ robot.R.T)
    )
    stiffness = _FOOT_GAINS[0] * model.scale.of('1/s^2')
    led = stiffness * (feet - robot.feet) - _FOOT_GAINS[1] * model.scale.of('1/s') * velocity
    task = WholeBodyTask(
        acceleration, is_stance, standing_forces(model.weight, is_stance), led, np.eye(3)
    )
    result = whole_body.solve(
        task,
        robot.R,
        robot.R.T @ robot.velocity,
        robot.omega,
        robot.motion,
        robot.contact,
        robot.dynamics,
    )
    damping = _DAMPING * model.scale.of('N m s/rad')
    return LegCommand(
        position=robot.joint_position.copy(), effort=result.torque, kd=np.full(12, damping)
    )
