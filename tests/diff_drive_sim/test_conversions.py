# SPDX-License-Identifier: Apache-2.0
import math

from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.parameters import DiffDriveParameters, UNKNOWN
import numpy as np
import pytest


@pytest.fixture
def unit(mbot):
    return DiffDrive(mbot, DiffDriveParameters())


def test_odometry_says_where_the_wheels_are_and_how_they_move(unit, monkeypatch):
    state = OdometryState(x=1.0, y=-2.0, yaw=7.0, linear=0.3, angular=-0.4, lateral=0.1)
    monkeypatch.setattr(type(unit.controller), 'odometry_state', state)
    odometry = unit.odometry
    assert odometry.position.tolist() == [1.0, -2.0, 0.0]
    assert odometry.linear_velocity.tolist() == [0.3, 0.1, 0.0]
    assert odometry.angular_velocity.tolist() == [0.0, 0.0, -0.4]
    w, x, y, z = odometry.orientation.tolist()
    assert (x, y) == (0.0, 0.0)
    turned = math.remainder(2.0 * math.atan2(z, w) - 7.0, 2.0 * math.pi)
    assert turned == pytest.approx(0.0, abs=1e-12)


def test_covariances_say_what_a_planar_robot_does_not_know(unit):
    for matrix in (unit.odometry.pose_covariance, unit.odometry.twist_covariance):
        diagonal = np.diag(matrix)
        np.testing.assert_array_equal(matrix, np.diag(diagonal))
        assert (diagonal[[0, 1, 5]] < 1.0).all()
        np.testing.assert_array_equal(diagonal[[2, 3, 4]], UNKNOWN)
