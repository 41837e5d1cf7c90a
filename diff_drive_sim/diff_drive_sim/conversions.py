# SPDX-License-Identifier: Apache-2.0
"""The controller's states as messages, and a pose back from one."""

from collections.abc import Sequence
import math

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from geometry_msgs.msg import TransformStamped
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from diff_drive_sim.controller import Velocity
from diff_drive_sim.errors import DiffDriveError
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.odometry_parameters import OdometryParameters
from diff_drive_sim.pose_covariance import PlanarCovariance

# x, y, z, roll, pitch, yaw on the diagonal of a 6 x 6 covariance, row-major.
_DIAGONAL = slice(0, 36, 7)


def to_odometry(
    state: OdometryState, covariance: PlanarCovariance, stamp: Time, parameters: OdometryParameters
) -> Odometry:
    """Return nav_msgs/Odometry: pose in the odom frame, twist in the base frame."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = parameters.odom_frame_id
    message.child_frame_id = parameters.base_frame_id
    message.pose.pose.position.x = state.x
    message.pose.pose.position.y = state.y
    message.pose.pose.orientation.z = math.sin(0.5 * state.yaw)
    message.pose.pose.orientation.w = math.cos(0.5 * state.yaw)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = state.linear, state.lateral, state.angular
    pose = message.pose.covariance
    pose[_DIAGONAL] = parameters.pose_covariance_diagonal
    pose[0] += covariance.xx
    pose[7] += covariance.yy
    pose[35] += covariance.yaw_yaw
    pose[1] = pose[6] = covariance.xy
    pose[5] = pose[30] = covariance.x_yaw
    pose[11] = pose[31] = covariance.y_yaw
    error = parameters.twist_error
    message.twist.covariance[_DIAGONAL] = parameters.twist_covariance_diagonal
    message.twist.covariance[0] += (error * state.linear) ** 2
    message.twist.covariance[7] += (error * state.lateral) ** 2
    message.twist.covariance[35] += (error * state.angular) ** 2
    return message


def to_transform(
    state: OdometryState, stamp: Time, parameters: OdometryParameters
) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = parameters.odom_frame_id
    message.child_frame_id = parameters.base_frame_id
    message.transform.translation.x = state.x
    message.transform.translation.y = state.y
    message.transform.rotation.z = math.sin(0.5 * state.yaw)
    message.transform.rotation.w = math.cos(0.5 * state.yaw)
    return message


def from_pose(
    message: PoseWithCovarianceStamped, frame: str
) -> tuple[float, float, float, PlanarCovariance]:
    """
    Return x, y [m], yaw [rad] and their covariance.

    Raises:
        DiffDriveError: the pose is in another frame than `frame`, or is no pose.
    """
    if message.header.frame_id not in ('', frame):
        raise DiffDriveError(
            f'wanted a pose in frame {frame!r}, got one in {message.header.frame_id!r}'
        )
    position, q = message.pose.pose.position, message.pose.pose.orientation
    c = message.pose.covariance
    numbers = (position.x, position.y, q.x, q.y, q.z, q.w, *c)
    if not all(map(math.isfinite, numbers)) or q.x == q.y == q.z == q.w == 0.0:
        raise DiffDriveError('wanted a pose of finite numbers and an orientation that is not 0')
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    return position.x, position.y, yaw, PlanarCovariance(c[0], c[1], c[7], c[5], c[11], c[35])


def to_twist_stamped(velocity: Velocity, stamp: Time, frame: str) -> TwistStamped:
    """Return a velocity of the base frame."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.twist.linear.x, message.twist.angular.z = velocity
    return message


def to_wheel_states(
    names: Sequence[str], positions: Sequence[float], velocities: Sequence[float], stamp: Time
) -> JointState:
    """Return sensor_msgs/JointState of wheels at positions [rad] and velocities [rad/s]."""
    message = JointState(name=list(names), position=list(positions), velocity=list(velocities))
    message.header.stamp = stamp
    return message


def to_diagnostics(
    name: str, state: str, ticks: tuple[int, int], odometry: OdometryState, stamp: Time
) -> DiagnosticArray:
    """Return what arbotix says of a controller: Left and Right ticks, dX [m/s], dR [rad/s]."""
    values = {
        'Left': str(ticks[0]),
        'Right': str(ticks[1]),
        'dX': str(odometry.linear),
        'dR': str(odometry.angular),
    }
    status = DiagnosticStatus(name=name, level=DiagnosticStatus.OK, message=state)
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message
