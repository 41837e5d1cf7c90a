# SPDX-License-Identifier: Apache-2.0
"""Compiles everything the controller compiles, so that the first robot need not wait for it."""

import numpy as np

from quadruped_sim.leg_controller import LegController
from quadruped_sim.parameters import GaitParameters
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.records import Sensors
from quadruped_sim.robot_model import RobotModel


def warm_up(model: RobotModel) -> None:
    """
    Run a controller for a moment on the reading of a robot that stands still.

    Afterwards the model is as it was: it keeps nothing from one tick to the next.

    Takes some seconds the first time on a machine and a fraction of one later, when the compiled
    functions come from numba's cache.
    """
    params = LegControllerParameters(gait=GaitParameters(step_in_place=True))
    controller = LegController(model, params)
    standing = Sensors(
        joint_position=model.walking_pose,
        joint_velocity=np.zeros(12),
        joint_effort=np.zeros(12),
        imu_orientation=np.array((1.0, 0.0, 0.0, 0.0)),
        imu_angular_velocity=np.zeros(3),
        imu_linear_acceleration=np.array((0.0, 0.0, 9.81)),
    )
    for key in '24':
        controller.press(key)
        for _ in range(30):
            controller.step(standing, 0.002)
