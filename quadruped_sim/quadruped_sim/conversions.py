# SPDX-License-Identifier: Apache-2.0
"""The leg controller's states as messages, and readings from messages."""

from collections.abc import Sequence
from typing import NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from mujoco_sim.base_state import BaseState as TrueBase
from mujoco_sim.conversions import rotate_inverse
from mujoco_sim.sensors import ImuReading
from mujoco_sim.sensors import JointStates
from mujoco_sim.sensors import Reading
from mujoco_sim.world import JointCommand
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from sensor_msgs.msg import Imu
from sensor_msgs.msg import JointState

from quadruped_sim.joint_map import JointMap
from quadruped_sim.records import BaseState
from quadruped_sim.records import LegCommand
from quadruped_sim.records import Odometry
from quadruped_sim.records import Sensors


class Frames(NamedTuple):
    """Names of the frame in which odometry is given, and of the robot's that it follows."""

    odom: str
    base: str


def to_sensors(reading: Reading, joints: JointMap, truth: TrueBase | None) -> Sensors:
    """Return a reading as the controller has it, in leg angles."""
    assert reading.imu is not None  # the node refuses a robot without one
    states, imu = reading.joints, reading.imu
    return Sensors(
        joint_position=joints.angles(states.position),
        joint_velocity=joints.rates(states.velocity),
        joint_effort=joints.rates(states.effort),
        imu_orientation=imu.orientation,
        imu_angular_velocity=imu.angular_velocity,
        imu_linear_acceleration=imu.linear_acceleration,
        truth=to_base(truth) if truth is not None else None,
    )


def to_base(truth: TrueBase) -> BaseState:
    """Return the simulator's base state as the controller's record."""
    return BaseState(
        truth.position, truth.orientation, truth.linear_velocity, truth.angular_velocity
    )


def to_joint_command(command: LegCommand, joints: JointMap) -> JointCommand:
    """Return a command as the simulator's motors take it."""
    motors = joints.command(command)
    return JointCommand(motors.position, motors.velocity, motors.effort, motors.kp, motors.kd)


def from_messages(joints: JointState, imu: Imu) -> Reading:
    """Return the reading of two messages."""
    q, w, a = imu.orientation, imu.angular_velocity, imu.linear_acceleration
    return Reading(
        JointStates(np.array(joints.position), np.array(joints.velocity), np.array(joints.effort)),
        ImuReading(
            np.array((q.w, q.x, q.y, q.z)),
            np.array((w.x, w.y, w.z)),
            np.array((a.x, a.y, a.z)),
        ),
    )


def from_odometry(message: OdometryMessage) -> TrueBase:
    """Return the base state of `ground_truth/odom`: its twist is in the base frame."""
    p, q = message.pose.pose.position, message.pose.pose.orientation
    v, w = message.twist.twist.linear, message.twist.twist.angular
    orientation = np.array((q.w, q.x, q.y, q.z))
    conjugate = orientation * (1.0, -1.0, -1.0, -1.0)
    velocity = rotate_inverse(conjugate, np.array((v.x, v.y, v.z)))
    return TrueBase(np.array((p.x, p.y, p.z)), orientation, velocity, np.array((w.x, w.y, w.z)))


def to_odometry(state: Odometry, stamp: Time, frames: Frames) -> OdometryMessage:
    """Return nav_msgs/Odometry: pose in the odom frame, twist in the base frame."""
    message = OdometryMessage()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.pose.pose.position, state.position)
    _set_wxyz(message.pose.pose.orientation, state.orientation)
    _set_xyz(message.twist.twist.linear, state.linear_velocity)
    _set_xyz(message.twist.twist.angular, state.angular_velocity)
    message.pose.covariance[:] = state.pose_covariance.flatten()
    message.twist.covariance[:] = state.twist_covariance.flatten()
    return message


def to_transform(state: Odometry, stamp: Time, frames: Frames) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.transform.translation, state.position)
    _set_wxyz(message.transform.rotation, state.orientation)
    return message


def _set_xyz(target: object, values: Sequence[float]) -> None:
    target.x, target.y, target.z = map(float, values)  # type: ignore[attr-defined]


def _set_wxyz(target: object, values: Sequence[float]) -> None:
    target.w, target.x, target.y, target.z = map(float, values)  # type: ignore[attr-defined]
