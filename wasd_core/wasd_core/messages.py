# SPDX-License-Identifier: Apache-2.0
"""Times, poses, the records of robot_io, points and diagnostics as messages, and back."""

import array
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
import numpy as np
from numpy.typing import ArrayLike
from sensor_msgs.msg import Imu, JointState, PointCloud2, PointField
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wasd_core.errors import InvalidMessage
from wasd_core.robot_io import BaseOdometry, BaseState, ImuReading, JointCommand, JointStates
from wasd_core.rotations import Pose, rotate_inverse, to_quaternion

# PointCloud2's constants for numpy's types.
CLOUD_TYPES = {
    '<f4': PointField.FLOAT32,
    '<u2': PointField.UINT16,
    '<f8': PointField.FLOAT64,
}


def to_seconds(stamp: Time) -> float:
    """Return the time of a stamp [s]."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def to_transform(pose: Pose, parent: str, child: str, stamp: Time) -> TransformStamped:
    """Return the pose of the child frame in the parent frame as a transform."""
    turn = np.array(to_quaternion(pose.rotation))
    return _to_transform(pose.position, turn, parent, child, stamp)


def _to_transform(
    position: np.ndarray, orientation: np.ndarray, parent: str, child: str, stamp: Time
) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = stamp, parent
    _set_xyz(message.transform.translation, position)
    _set_wxyz(message.transform.rotation, orientation)
    return message


def to_stamp(simulated: float) -> Time:
    """Return simulated time [s] as a stamp."""
    nanoseconds = round(simulated * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def to_joint_state(
    names: Sequence[str],
    stamp: Time,
    position: ArrayLike = (),
    velocity: ArrayLike = (),
    effort: ArrayLike = (),
) -> JointState:
    """Return sensor_msgs/JointState."""
    message = JointState(name=list(names))
    message.header.stamp = stamp
    message.position = np.asarray(position).tolist()
    message.velocity = np.asarray(velocity).tolist()
    message.effort = np.asarray(effort).tolist()
    return message


def to_diagnostics(
    name: str, text: str, values: Mapping[str, str], stamp: Time, is_warning: bool = False
) -> DiagnosticArray:
    """Return one diagnostic status with its values."""
    status = DiagnosticStatus(name=name, message=text)
    status.level = DiagnosticStatus.WARN if is_warning else DiagnosticStatus.OK
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def to_cloud(points: np.ndarray, header: Header, is_dense: bool = True) -> PointCloud2:
    """Return points (rows, columns), whose fields have types of CLOUD_TYPES, as a message."""
    described = points.dtype.fields
    assert described is not None
    rows, columns = points.shape
    return PointCloud2(
        header=header,
        height=rows,
        width=columns,
        fields=[
            PointField(name=name, offset=offset, datatype=CLOUD_TYPES[kind.str], count=1)
            for name, (kind, offset, *_) in described.items()
        ],
        is_bigendian=False,
        point_step=points.dtype.itemsize,
        row_step=points.dtype.itemsize * columns,
        data=array.array('B', points.tobytes()),
        is_dense=is_dense,
    )


def to_imu(reading: ImuReading, frame: str, stamp: Time) -> Imu:
    """Return sensor_msgs/Imu; the readings are in the axes of the robot's root."""
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp, frame
    _set_wxyz(message.orientation, reading.orientation)
    _set_xyz(message.angular_velocity, reading.angular_velocity)
    _set_xyz(message.linear_acceleration, reading.linear_acceleration)
    return message


def to_joint_states(message: JointState) -> JointStates:
    """Return the joints of a message, in its order."""
    columns = message.position, message.velocity, message.effort
    return JointStates(*map(np.array, columns))


def to_imu_reading(message: Imu) -> ImuReading:
    """Return what an IMU measured."""
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    return ImuReading(
        np.array((q.w, q.x, q.y, q.z)), np.array((w.x, w.y, w.z)), np.array((a.x, a.y, a.z))
    )


def to_odometry(odometry: BaseOdometry, frame: str, base: str, stamp: Time) -> Odometry:
    """Return nav_msgs/Odometry: pose in the odom `frame`, twist in that of the `base`."""
    message = Odometry()
    message.header.stamp, message.header.frame_id = stamp, frame
    message.child_frame_id = base
    _set_xyz(message.pose.pose.position, odometry.position)
    _set_wxyz(message.pose.pose.orientation, odometry.orientation)
    _set_xyz(message.twist.twist.linear, odometry.linear_velocity)
    _set_xyz(message.twist.twist.angular, odometry.angular_velocity)
    message.pose.covariance[:] = odometry.pose_covariance.flatten()
    message.twist.covariance[:] = odometry.twist_covariance.flatten()
    return message


def to_base_transform(
    odometry: BaseOdometry, frame: str, base: str, stamp: Time
) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    return _to_transform(odometry.position, odometry.orientation, frame, base, stamp)


def from_odometry(message: Odometry) -> BaseOdometry:
    """Return the odometry of a message."""
    pose, twist = message.pose, message.twist
    p, q, v, w = pose.pose.position, pose.pose.orientation, twist.twist.linear, twist.twist.angular
    return BaseOdometry(
        np.array((p.x, p.y, p.z)),
        np.array((q.w, q.x, q.y, q.z)),
        np.array((v.x, v.y, v.z)),
        np.array((w.x, w.y, w.z)),
        np.array(pose.covariance).reshape(6, 6),
        np.array(twist.covariance).reshape(6, 6),
    )


def _set_xyz(target: Any, values: np.ndarray) -> None:
    target.x, target.y, target.z = values.tolist()


def _set_wxyz(target: Any, values: np.ndarray) -> None:
    target.w, target.x, target.y, target.z = values.tolist()


def to_base_state(message: Odometry) -> BaseState:
    """Return the base state of `ground_truth/odom`: its twist is in the base frame."""
    position, orientation, velocity, rate, *_ = from_odometry(message)
    conjugate = orientation * (1.0, -1.0, -1.0, -1.0)
    return BaseState(position, orientation, rotate_inverse(conjugate, velocity), rate)


def to_joint_commands(names: Sequence[str], command: JointCommand, stamp: Time) -> JointTrajectory:
    """
    Return a joint command as trajectory_msgs/JointTrajectory of two points.

    The first point is the set-point: positions, velocities, effort. The second holds the gains
    in the slots of what they multiply: kp in positions, kd in velocities.
    """
    message = JointTrajectory()
    message.header.stamp = stamp
    message.joint_names = list(names)
    message.points = [
        JointTrajectoryPoint(
            positions=command.position.tolist(),
            velocities=command.velocity.tolist(),
            effort=command.effort.tolist(),
        ),
        JointTrajectoryPoint(positions=command.kp.tolist(), velocities=command.kd.tolist()),
    ]
    return message


def from_joint_commands(message: JointTrajectory, names: Sequence[str]) -> JointCommand:
    """
    Return the command of a message in the order of `names`; joints it leaves out get zeros.

    Raises:
        InvalidMessage: an unknown joint, a missing gain point, or lists of different lengths.
    """
    if len(message.points) != 2:
        raise InvalidMessage(
            f'joint_commands needs 2 points (set-point, gains), got {len(message.points)}'
        )
    unknown = sorted(set(message.joint_names) - set(names))
    if unknown:
        raise InvalidMessage(
            f'joint_commands names {", ".join(unknown)}; motors are {", ".join(names)}'
        )
    places = [names.index(name) for name in message.joint_names]
    setpoint, gains = message.points
    columns = (
        setpoint.positions,
        setpoint.velocities,
        setpoint.effort,
        gains.positions,
        gains.velocities,
    )
    parts = []
    for column in columns:
        if len(column) not in (0, len(places)):
            raise InvalidMessage(
                f'joint_commands has {len(places)} joints but a list of {len(column)} values'
            )
        part = np.zeros(len(names))
        if len(column):
            part[places] = column
        parts.append(part)
    return JointCommand(*parts)
