# SPDX-License-Identifier: Apache-2.0
"""The simulator's states as messages, and joint commands back from a message."""

from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from nav_msgs.msg import Odometry
import numpy as np
from sensor_msgs.msg import Imu
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from mujoco_sim.base_state import BaseState
from mujoco_sim.errors import SimulationError
from mujoco_sim.sensors import ImuReading
from mujoco_sim.sensors import JointStates
from mujoco_sim.wheel_slip import Slip
from mujoco_sim.world import JointCommand


def to_stamp(simulated: float) -> Time:
    """Return simulated time [s] as a stamp."""
    nanoseconds = round(simulated * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def to_joint_state(names: Sequence[str], joints: JointStates, stamp: Time) -> JointState:
    """Return sensor_msgs/JointState with position, velocity and effort."""
    message = JointState()
    message.header.stamp = stamp
    message.name = list(names)
    message.position = joints.position.tolist()
    message.velocity = joints.velocity.tolist()
    message.effort = joints.effort.tolist()
    return message


def to_ground_truth(base: BaseState, frame: str, child_frame: str, stamp: Time) -> Odometry:
    """Return the true pose in `frame`, that of odometry, and the twist in the base frame."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.child_frame_id = child_frame
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y, position.z = base.position.tolist()
    orientation.w, orientation.x, orientation.y, orientation.z = base.orientation.tolist()
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    linear.x, linear.y, linear.z = rotate_inverse(base.orientation, base.linear_velocity).tolist()
    angular.x, angular.y, angular.z = base.angular_velocity.tolist()
    return message


def to_odometry_error(truth: Odometry, odometry: Odometry) -> Odometry:
    """
    Return truth - odometry of one instant, in the odom frame.

    The position is the difference of the two, the orientation the turn from odometry's to the
    true one, the twist the difference of the two, in the base frame.
    """
    message = Odometry()
    message.header = odometry.header
    message.child_frame_id = odometry.child_frame_id
    true, estimated = truth.pose.pose, odometry.pose.pose
    _subtract(true.position, estimated.position, message.pose.pose.position)
    t, e, turn = true.orientation, estimated.orientation, message.pose.pose.orientation
    # t times the conjugate of e.
    turn.w = t.w * e.w + t.x * e.x + t.y * e.y + t.z * e.z
    turn.x = t.x * e.w - t.w * e.x - t.y * e.z + t.z * e.y
    turn.y = t.y * e.w - t.w * e.y - t.z * e.x + t.x * e.z
    turn.z = t.z * e.w - t.w * e.z - t.x * e.y + t.y * e.x
    true, estimated, twist = truth.twist.twist, odometry.twist.twist, message.twist.twist
    _subtract(true.linear, estimated.linear, twist.linear)
    _subtract(true.angular, estimated.angular, twist.angular)
    return message


def _subtract(minuend: Any, subtrahend: Any, difference: Any) -> None:
    for axis in ('x', 'y', 'z'):
        setattr(difference, axis, getattr(minuend, axis) - getattr(subtrahend, axis))


def to_wheel_slip(names: Sequence[str], slips: Sequence[Slip], stamp: Time) -> JointState:
    """Return the slip of wheels: joint names, ratios as positions, speeds [m/s] as velocities."""
    message = JointState()
    message.header.stamp = stamp
    message.name = list(names)
    message.position = [slip.ratio for slip in slips]
    message.velocity = [slip.speed for slip in slips]
    return message


def to_imu(reading: ImuReading, frame: str, stamp: Time) -> Imu:
    """Return sensor_msgs/Imu; the readings are in the axes of the robot's root."""
    message = Imu()
    message.header.stamp = stamp
    message.header.frame_id = frame
    orientation, rate = message.orientation, message.angular_velocity
    force = message.linear_acceleration
    orientation.w, orientation.x, orientation.y, orientation.z = reading.orientation.tolist()
    rate.x, rate.y, rate.z = reading.angular_velocity.tolist()
    force.x, force.y, force.z = reading.linear_acceleration.tolist()
    return message


def to_foot_contacts(names: Sequence[str], forces: np.ndarray, stamp: Time) -> JointState:
    """Return the normal force on each foot [N]: link names, and the forces as efforts."""
    message = JointState()
    message.header.stamp = stamp
    message.name = list(names)
    message.effort = forces.tolist()
    return message


def rotate_inverse(orientation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return a world-frame vector in the frame of a quaternion (w, x, y, z), shape (3,)."""
    # In plain numbers: np.cross takes 20 us for one of these. With q the vector part of the
    # inverse and u = q x v, the result is v + 2 (w u + q x u).
    w, x, y, z = orientation.tolist()
    a, b, c = vector.tolist()
    d, e, f = z * b - y * c, x * c - z * a, y * a - x * b
    return np.array(
        [
            a + 2.0 * (w * d + z * e - y * f),
            b + 2.0 * (w * e + x * f - z * d),
            c + 2.0 * (w * f + y * d - x * e),
        ]
    )


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
        SimulationError: an unknown joint, a missing gain point, or lists of different lengths.
    """
    if len(message.points) != 2:
        raise SimulationError(
            f'joint_commands needs 2 points (set-point, gains), got {len(message.points)}'
        )
    unknown = sorted(set(message.joint_names) - set(names))
    if unknown:
        raise SimulationError(
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
            raise SimulationError(
                f'joint_commands has {len(places)} joints but a list of {len(column)} values'
            )
        part = np.zeros(len(names))
        if len(column):
            part[places] = column
        parts.append(part)
    return JointCommand(*parts)


def to_diagnostics(
    name: str, text: str, values: dict[str, str], warn: bool, stamp: Time
) -> DiagnosticArray:
    """Return one diagnostic status with its values."""
    message = DiagnosticArray()
    message.header.stamp = stamp
    status = DiagnosticStatus(name=name, message=text)
    status.level = DiagnosticStatus.WARN if warn else DiagnosticStatus.OK
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    message.status = [status]
    return message
