# SPDX-License-Identifier: Apache-2.0
"""Messages: cmd_vel of both types in, odometry and the like out, a pose back from one."""

from collections.abc import Callable, Sequence
import math
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState
from wasd_core.topics import LoopbackSubscription, RELIABLE

from diff_drive_sim.controller import Velocity
from diff_drive_sim.odometry import DiffDriveError, OdometryState, PlanarCovariance


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


TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
# How often publishers of the other type are looked for, and their messages taken [s, wall time].
LOOK_PERIOD = 0.5
TAKE_PERIOD = 0.005


class VelocityInput:
    """
    Passes messages of cmd_vel on, to `on_twist` and `on_stamped`.

    A DDS participant knows one type per topic. With `stamped` `auto` this one listens for Twist;
    once somebody publishes TwistStamped, a second participant listens for that. `expect` drops the
    echo of a message of this process; `is_stale` and `admit` judge those of others, as a
    LoopbackSubscription's do. `admit` is asked about the Twist.
    """

    def __init__(
        self,
        node: Node,
        stamped: str,
        on_twist: Callable[[Twist], None],
        on_stamped: Callable[[TwistStamped], None],
        is_stale: Callable[[int], bool] = lambda sent: False,
    ) -> None:
        self._node = node
        self._is_stale = is_stale
        self.admit: Callable[[Twist], bool] = lambda twist: True
        self._handlers: dict[type, Callable[[Any], None]] = {
            Twist: on_twist,
            TwistStamped: on_stamped,
        }
        self._type = TwistStamped if stamped == 'true' else Twist
        self._subscription: LoopbackSubscription[Any] = LoopbackSubscription(
            node, self._type, 'cmd_vel', self._handlers[self._type], RELIABLE, is_stale
        )
        self._subscription.admit = self._is_admitted
        self._topic = node.resolve_topic_name('cmd_vel')
        self._other: _OtherParticipant | None = None
        if stamped == 'auto':
            self._wall = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=self._wall)

    def expect(self, message: Any) -> None:
        """Drop the echo of a message that this process is publishing."""
        if isinstance(message, self._type):
            self._subscription.expect(message)

    def put(self, message: Any) -> None:
        """Hand over a message that this process publishes, too."""
        self.expect(message)
        self._handlers[type(message)](message)

    def _is_admitted(self, message: Any) -> bool:
        return self.admit(message if isinstance(message, Twist) else message.twist)

    def close(self) -> None:
        """Leave the second participant."""
        if self._other is not None:
            self._other.close()

    def _look(self) -> None:
        """Listen for the other type as soon as somebody publishes it."""
        for info in self._node.get_publishers_info_by_topic(self._topic):
            kind = TYPES.get(info.topic_type, self._type)
            if kind is not self._type:
                self._other = _OtherParticipant(self._node, kind, self._topic)
                self._node.destroy_timer(self._timer)
                self._timer = self._node.create_timer(TAKE_PERIOD, self._take, clock=self._wall)
                return

    def _take(self) -> None:
        assert self._other is not None
        for message, sent in self._other.take():
            if not self._is_stale(sent) and self._is_admitted(message):
                self._subscription.notify(message)
                self._handlers[type(message)](message)


class _OtherParticipant:
    """A subscription in a context of its own, asked for its messages."""

    def __init__(self, node: Node, message_type: type, topic: str) -> None:
        self._type = message_type
        self._context = Context()
        self._context.init(args=[], domain_id=node.context.get_domain_id())
        self._node = rclpy.create_node(
            f'{node.get_name()}_stamped_input',
            namespace=node.get_namespace(),
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._subscription = self._node.create_subscription(
            message_type, topic, lambda message: None, RELIABLE
        )

    def take(self) -> list[tuple[Any, int]]:
        """Return the messages that have arrived, and when they were sent [ns of system time]."""
        found = []
        while (taken := self._subscription.handle.take_message(self._type, False)) is not None:
            found.append((taken[0], taken[1]['source_timestamp']))
        return found

    def close(self) -> None:
        self._node.destroy_node()
        self._context.try_shutdown()
