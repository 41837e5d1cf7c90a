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
from sensor_msgs.msg import JointState
from wasd_core.robot_io import BaseState
from wasd_core.rotations import rotate_inverse

from mujoco_sim.sensors.wheel_slip import Slip


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


def to_foot_contacts(names: Sequence[str], forces: np.ndarray, stamp: Time) -> JointState:
    """Return the normal force on each foot [N]: link names, and the forces as efforts."""
    message = JointState()
    message.header.stamp = stamp
    message.name = list(names)
    message.effort = forces.tolist()
    return message


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
