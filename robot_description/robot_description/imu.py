# SPDX-License-Identifier: Apache-2.0
"""Where a robot's IMU is."""

import numpy as np

from robot_description.quadruped import links_on_trunk
from robot_description.quadruped import poses_in_base
from robot_description.urdf import Robot

# Names that are an IMU's, the likeliest first; then any that has `imu` in it.
IMU_LINKS = ('imu', 'imu_link')


def find_imu(robot: Robot) -> str | None:
    """Return the link on the trunk that is an IMU by its name, or None."""
    trunk = links_on_trunk(robot)
    by_name = [link for link in IMU_LINKS if link in trunk]
    return next(iter([*by_name, *(link for link in trunk if 'imu' in link.lower())]), None)


def imu_position(robot: Robot) -> np.ndarray:
    """Return where the IMU is in the base (3,) [m]; its origin when the robot names none."""
    link = find_imu(robot)
    return np.zeros(3) if link is None else poses_in_base(robot)[link].position
