# SPDX-License-Identifier: Apache-2.0
"""mbot's wheels."""

from descriptions import robot_named
from diff_drive_sim.odometry import DiffDriveGeometry
import pytest
from robot_description.robot import Robot


@pytest.fixture(scope='session')
def geometry() -> DiffDriveGeometry:
    """Return the geometry of mbot: track 0.38 m, radius 0.06 m."""
    return DiffDriveGeometry('left_wheel_joint', 'right_wheel_joint', 0.06, 0.38)


@pytest.fixture(scope='session')
def mbot() -> Robot:
    """Return mbot's description."""
    return robot_named('mbot').robot
