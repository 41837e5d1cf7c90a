# SPDX-License-Identifier: Apache-2.0
"""What goes into a message comes out of it; odometry and transform are one pose."""

import math

from builtin_interfaces.msg import Time
from mujoco_sim.truth_publisher import to_ground_truth
import numpy as np
import pytest
from quadruped_sim.robot_model import JointMap
from sensor_msgs.msg import JointState
from wasd_core.messages import (
    from_odometry,
    to_base_state,
    to_base_transform,
    to_imu,
    to_imu_reading,
    to_joint_states,
    to_odometry,
)
from wasd_core.robot_io import (
    BaseOdometry,
    BaseState,
    ImuReading,
    JointCommand,
    JointStates,
    Reading,
)


@pytest.fixture
def reading(rng):
    joints = JointStates(rng.normal(size=12), rng.normal(size=12), rng.normal(size=12))
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    return joints, ImuReading(quaternion, rng.normal(size=3), rng.normal(size=3))


def test_the_truth_survives_its_message():
    half = math.sqrt(0.5)
    truth = BaseState(
        np.array((1.0, 2.0, 0.3)),
        np.array((half, 0.0, 0.0, half)),
        np.array((0.1, 0.2, 0.3)),
        np.array((0.4, 0.5, 0.6)),
    )
    message = to_ground_truth(truth, 'odom', 'base', Time())
    # In the base frame: the robot looks along y.
    assert message.twist.twist.linear.x == pytest.approx(0.2)
    for one, other in zip(to_base_state(message), truth, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_a_reading_survives_its_messages(reading, model):
    joints, imu = reading
    message = JointState(name=list(model.quadruped.joint_names), position=joints.position.tolist())
    message.velocity, message.effort = joints.velocity.tolist(), joints.effort.tolist()
    back = to_joint_states(message), to_imu_reading(to_imu(imu, 'base', Time()))
    for one, other in zip((*back[0], *back[1]), (*joints, *imu), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_reading_is_put_into_the_controllers_order_by_name(reading, model):
    names = model.quadruped.joint_names
    joints = JointMap(model.quadruped, names[::-1], names)
    ordered = joints.reading(Reading(*reading))
    for one, other in zip(ordered.joints, reading[0], strict=True):
        np.testing.assert_array_equal(one, other[::-1])
    assert ordered.imu is reading[1]


def test_a_joint_that_is_none_of_the_legs_is_left_out_wherever_it_stands(reading, model):
    names = model.quadruped.joint_names
    for at in (0, 5, 12):
        theirs = (*names[:at], 'antenna', *names[at:])
        more = JointStates(*(np.insert(part, at, np.nan) for part in reading[0]))
        legs = JointMap(model.quadruped, theirs, names).reading(Reading(more, reading[1]))
        for one, other in zip(legs.joints, reading[0], strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_command_is_put_into_the_motors_order_by_name(rng, model):
    names = model.quadruped.joint_names
    command = JointCommand(*(rng.normal(size=12) for _ in range(5)))
    ordered = JointMap(model.quadruped, names, names[::-1]).command(command)
    for name in ('position', 'velocity', 'effort', 'kp', 'kd'):
        np.testing.assert_array_equal(getattr(ordered, name), getattr(command, name)[::-1])


@pytest.mark.slow
def test_odometry_and_transform_carry_one_pose_and_one_stamp(rng):
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    state = BaseOdometry(
        rng.normal(size=3), quaternion, rng.normal(size=3), rng.normal(size=3),
        np.diag(np.arange(6.0)), 2.0 * np.eye(6),
    )  # fmt: skip
    stamp = Time(sec=3, nanosec=5)
    odometry = to_odometry(state, 'odom', 'trunk', stamp)
    transform = to_base_transform(state, 'odom', 'trunk', stamp)
    assert odometry.header == transform.header
    assert odometry.child_frame_id == transform.child_frame_id == 'trunk'
    assert odometry.pose.pose.orientation == transform.transform.rotation
    assert odometry.pose.pose.position.y == transform.transform.translation.y == state.position[1]
    assert odometry.twist.twist.linear.x == state.linear_velocity[0]
    assert odometry.twist.twist.angular.z == state.angular_velocity[2]
    assert list(odometry.pose.covariance[:8]) == [0, 0, 0, 0, 0, 0, 0, 1]
    for one, other in zip(from_odometry(odometry), state, strict=True):
        np.testing.assert_array_equal(one, other)
