# SPDX-License-Identifier: Apache-2.0
import math

from builtin_interfaces.msg import Time
from diff_drive_sim.messages import to_odometry, to_transform
from diff_drive_sim.odometry import OdometryState, PlanarCovariance
from diff_drive_sim.parameters import DiffDriveParameters, UNKNOWN
import numpy as np
import pytest

PARAMETERS = DiffDriveParameters(base_frame_id='base_footprint')


def test_odometry_and_transform_carry_one_pose_and_one_stamp():
    stamp = Time(sec=2, nanosec=7)
    state = OdometryState(x=1.0, y=-2.0, yaw=7.0, linear=0.3, angular=-0.4, lateral=0.1)
    odometry = to_odometry(state, PlanarCovariance(), stamp, PARAMETERS)
    transform = to_transform(state, stamp, PARAMETERS)
    assert odometry.header == transform.header
    assert odometry.child_frame_id == transform.child_frame_id == 'base_footprint'
    assert odometry.pose.pose.orientation == transform.transform.rotation
    assert odometry.pose.pose.position.x == transform.transform.translation.x == 1.0
    rotation = transform.transform.rotation
    turned = math.remainder(2.0 * math.atan2(rotation.z, rotation.w) - 7.0, 2.0 * math.pi)
    assert turned == pytest.approx(0.0, abs=1e-12)
    assert odometry.twist.twist.linear.x == 0.3
    assert odometry.twist.twist.linear.y == 0.1
    assert odometry.twist.twist.angular.z == -0.4


def test_covariances_say_what_a_planar_robot_does_not_know():
    odometry = to_odometry(OdometryState(), PlanarCovariance(), Time(), PARAMETERS)
    for covariance in (odometry.pose.covariance, odometry.twist.covariance):
        matrix = np.array(covariance).reshape(6, 6)
        diagonal = np.diag(matrix)
        np.testing.assert_array_equal(matrix, np.diag(diagonal))
        assert (diagonal[[0, 1, 5]] < 1.0).all()
        np.testing.assert_array_equal(diagonal[[2, 3, 4]], UNKNOWN)
