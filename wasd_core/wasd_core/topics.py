# SPDX-License-Identifier: Apache-2.0
"""
Additions to rclpy's topics: quality of service, subscribers, lost publishers, echoes.

Publishers offer the most, subscribers to sensors ask for the least. So every ROS tool gets every
topic with either reliability, and a sensor's consumer never waits for a lost message. That is
REP 2003 for sensors (source: system default, which is reliable; consumer: sensor data, best
effort) and the habit of robot_state_publisher, tf2 and rclcpp for the others.
"""

from collections import deque
from collections.abc import Callable, Iterable
import importlib
import os
import time
from typing import Any, ClassVar, Generic, TypeVar

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile

from wasd_core.network import is_sourced
from wasd_core.timing import Absence, SHORTEST_ABSENCE
from wasd_core.velocity_messages import to_velocity, VELOCITY_TYPES

# Publishers of sensors, states, odometry, /clock; both ends of commands. Reliable, 10 deep.
RELIABLE = QoSProfile(depth=10)

# Keys: a burst, a paste or a script from a pipe, must not lose one.
EVENTS_DEPTH = 10_000
EVENTS = QoSProfile(depth=EVENTS_DEPTH)

# Subscribers to sensors, states, streamed joint commands: best effort, 5 deep (REP 2003).
SENSOR_DATA = qos_profile_sensor_data

# Subscribers that show the newest and nothing else.
LATEST = QoSProfile(depth=1, reliability=qos_profile_sensor_data.reliability)

# robot_description, state, selected: who comes late gets the last one. As robot_state_publisher.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

# As tf2: both have many senders and must not lose one; /tf_static is kept for who comes late.
TF = QoSProfile(depth=100)
TF_STATIC = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


# Full names of the topics that a Foxglove client follows; it is no ROS node.
FOLLOWED: set[str] = set()


def has_listener(publisher: Any) -> bool:
    """
    Whether a message would reach anybody; making and publishing one costs 50 us and more.

    Only for topics without latching: a late subscriber gets none of the earlier messages.
    """
    return bool(publisher.get_subscription_count())


def has_subscriber(node: Node, publisher: Any) -> bool:
    """
    Whether somebody has subscribed; other than for `has_listener`, a recording does not count.

    For what is too large to be made just because everything is recorded.
    """
    if not has_listener(publisher):
        return False
    topic = publisher.topic_name
    return topic in FOLLOWED or node.count_subscribers(topic) > 0


def tf_message_type() -> type[Any] | None:
    """Return tf2_msgs/TFMessage, or None where tf2_msgs is not installed (the wheels lack it)."""
    try:
        return importlib.import_module('tf2_msgs.msg').TFMessage  # type: ignore[no-any-return]
    except ImportError:
        return None


class TfBroadcaster:
    """Sends transforms on `/tf`, or latched on `/tf_static`; says once if it cannot."""

    _reported = False

    def __init__(self, node: Node, static: bool = False) -> None:
        self._type = tf_message_type()
        self._static = static
        if self._type is None:
            if not TfBroadcaster._reported:
                TfBroadcaster._reported = True
                cure = 'python -m robot_description.build_interfaces makes it'
                if is_sourced(os.environ):
                    cure = f'sudo apt install ros-{os.environ["ROS_DISTRO"]}-tf2-msgs'
                node.get_logger().info(f'tf2_msgs is not installed: /tf is not published ({cure})')
            return
        if static:
            self._publisher = node.create_publisher(self._type, '/tf_static', TF_STATIC)
        else:
            self._publisher = node.create_publisher(self._type, '/tf', TF)

    @property
    def available(self) -> bool:
        """Whether transforms reach anybody, now or later; otherwise they need not be made."""
        return self._type is not None and (self._static or has_listener(self._publisher))

    def send(self, transforms: Iterable[TransformStamped]) -> None:
        """Publish the transforms in one message; a generator is not run where nobody listens."""
        if self._type is not None and self.available:
            self._publisher.publish(self._type(transforms=list(transforms)))


# How often the publishers are counted [s of wall time: simulated time may stand still].
LOOK_PERIOD = 0.1


class PublisherWatch:
    """
    Calls `on_lost` when a topic that had publishers of others has none any more.

    What a key has set going may last longer than the key: a latched velocity, a stick. It must
    not last longer than the keyboard. DDS notices a publisher that ends at once, one whose process
    was killed when its lease runs out (20 s). So many publishers are our `own`.
    """

    def __init__(self, node: Node, topic: str, on_lost: Callable[[], None], own: int = 0) -> None:
        self._node, self._own = node, own
        self._topic = topic
        self._on_lost = on_lost
        self._had_any = False
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=clock)

    def _look(self) -> None:
        has_any = self._node.count_publishers(self._topic) > self._own
        if self._had_any and not has_any:
            self._on_lost()
        self._had_any = has_any


# How often a node shows that it lives [s of wall time].
BEAT_PERIOD = 0.1


class AbsenceWatch:
    """An Absence on wall time for a node; `on_return` is told how long the node was away [s]."""

    def __init__(self, node: Node, on_return: Callable[[float], None] = lambda gap: None) -> None:
        self._absence = Absence()
        self._on_return = on_return
        # Nobody sets this clock: a jump would look like an absence.
        self._ahead = time.time() - time.monotonic()
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(BEAT_PERIOD, self.beat, clock=wall)

    def beat(self) -> None:
        """Show that the process lives; to be called wherever it may come back to life."""
        gap = self._absence.beat(time.monotonic())
        if gap > 0.0:
            self._on_return(gap)

    def is_stale(self, sent: int) -> bool:
        """Whether a message sent at a system time [ns] is from before the last return."""
        self.beat()
        return self._absence.is_stale(1e-9 * sent - self._ahead, time.monotonic())


Message = TypeVar('Message')

# How long the middleware may take to bring back what this process published itself [s]. Under
# load, at --speed 0, a second of messages waits in its queues.
ECHO_LIFETIME = 10.0


class LoopbackSubscription(Generic[Message]):
    """
    A topic whose messages come from other processes; those of this one are dropped.

    What drives a robot in this process calls it directly, in the same simulated instant, so that
    runs repeat; the message is also published for everybody else, and the middleware brings it
    back to our own subscription. `expect` remembers such a message; its echo is then dropped.

    Echo and message are matched by their texts, which are equal also where NaN is in them; their
    bytes are not, as the middleware leaves anything in the gaps between fields. An equal message
    from outside that overtakes an echo is dropped in its place, and the echo delivered: the
    receiver sees the same. An echo that gets lost is waited for up to ECHO_LIFETIME; so long, one
    equal message from outside may be taken for it. What has come, and waits for a process that is
    late, is looked at before anything is given up.

    `is_stale` is asked about each message from another process, with the system time [ns] at
    which it was sent; what it calls stale is dropped, and so is what `admit` refuses. `hear`
    takes all others.
    """

    # Told of every message that came from another process, and of the subscription that took it.
    observers: ClassVar[list[Callable[['LoopbackSubscription[Any]', Any], None]]] = []

    def __init__(
        self,
        node: Node,
        message_type: type[Message],
        topic: str,
        callback: Callable[[Message], None],
        qos: QoSProfile = RELIABLE,
        is_stale: Callable[[int], bool] = lambda sent: False,
    ) -> None:
        self._type = message_type
        self._callback = callback
        self._is_stale = is_stale
        self.admit: Callable[[Message], bool] = lambda message: True
        # Of each message whose echo has not come when it was published, once for each time [s].
        self._pending: dict[str, deque[float]] = {}
        # rclpy passes a message's origin to a callback of two parameters; its types do not say so.
        on_message: Any = self._on_message
        self._subscription: Any = node.create_subscription(message_type, topic, on_message, qos)
        # On wall time, as the middleware is. It moves nothing: lock-step stays lock-step.
        self._looked_at = time.monotonic()
        self._timer: Any = node.create_timer(
            0.25 * ECHO_LIFETIME, self._forget, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def topic(self) -> str:
        """The topic's full name."""
        return str(self._subscription.topic_name)

    @property
    def qos_profile(self) -> QoSProfile:
        """The quality of service asked for."""
        qos: QoSProfile = self._subscription.qos_profile
        return qos

    def expect(self, message: Message) -> None:
        """Drop the echo of a message that this process is publishing."""
        times = self._pending.setdefault(repr(message), deque(maxlen=EVENTS_DEPTH))
        times.append(time.monotonic())

    def hear(self, message: Message) -> None:
        """Take a message that is no echo, if it counts, and tell the observers."""
        if self.admit(message):
            for tell in self.observers:
                tell(self, message)
            self._callback(message)

    def _on_message(self, message: Message, info: dict[str, int]) -> None:
        if not self._is_echo(message) and not self._is_stale(info['source_timestamp']):
            self.hear(message)

    def _is_echo(self, message: Message) -> bool:
        if not self._pending:
            return False
        received = repr(message)
        if received not in self._pending:
            return False
        self._pending[received].popleft()
        if not self._pending[received]:
            del self._pending[received]
        return True

    def _forget(self) -> None:
        """Give up echoes that were overdue at the last look already, and have not come since."""
        # A late timer looks again soon after.
        oldest = min(
            self._looked_at - 0.5 * ECHO_LIFETIME, time.monotonic() - 0.75 * ECHO_LIFETIME
        )
        if any(times[0] < oldest for times in self._pending.values()):
            # Timers come before messages, and a busy process may handle one between two looks.
            take = self._subscription.handle.take_message
            while (taken := take(self._type, False)) is not None:
                self._on_message(*taken)
        for sent, times in list(self._pending.items()):
            while times and times[0] < oldest:
                times.popleft()
            if not times:
                del self._pending[sent]
        self._looked_at = time.monotonic()


# What the middleware calls a node whose topics have come before its name.
UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'
# How often peers of the other type are looked for [s, wall time].
TYPES_PERIOD = 0.5


def watch_types(node: Node, kind: type[Any], *topics: str) -> None:
    """Say once of each topic that peers have the other type of velocity: nothing passes then."""
    watched = [node.resolve_topic_name(topic) for topic in topics]

    def look() -> None:
        for topic in list(watched):
            ends = [
                *node.get_publishers_info_by_topic(topic),
                *node.get_subscriptions_info_by_topic(topic),
            ]
            strange = {
                end.node_name
                for end in ends
                if VELOCITY_TYPES.get(end.topic_type, kind) is not kind
            } - {UNKNOWN_NODE}  # its name comes soon
            if strange:
                watched.remove(topic)
                names, ours = ', '.join(sorted(strange)), kind.__name__
                other = Twist.__name__ if kind is TwistStamped else TwistStamped.__name__
                # Some nodes know only Twist: then the others are to change.
                can_change = node.has_parameter('stamped')
                who, wanted = (node.get_name(), other) if can_change else (names, ours)
                cure = f'-p stamped:={wanted == TwistStamped.__name__}'.lower()
                # An error: an interactive run shows no warning of legs.
                node.get_logger().error(
                    f'{topic}: {names} has {other}, {node.get_name()} {ours}: nothing passes; '
                    f'let {who} have {wanted} ({cure})'
                )

    # Wall time: simulated time may stand still.
    node.create_timer(TYPES_PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME))


class VelocitySubscription(LoopbackSubscription[Any]):
    """
    Velocities of other processes on cmd_vel; an error names peers of the type that is not taken.

    `on_velocity` is told (vx, vy, wz) [m/s], [m/s], [rad/s] and the age [s], and says whether they
    count. `age_of` gives the age of a stamp, None for a message to be dropped.
    """

    def __init__(
        self,
        node: Node,
        on_velocity: Callable[[tuple[float, float, float], float], bool],
        is_stale: Callable[[int], bool] = lambda sent: False,
        stamped: bool = False,
        age_of: Callable[[Time], float | None] = lambda stamp: 0.0,
    ) -> None:
        self.on_velocity, self._age_of = on_velocity, age_of
        self._steps, self.came_at = Absence(), 0.0  # the last velocity, by `time.monotonic` [s]
        self.type: type[Any] = TwistStamped if stamped else Twist
        super().__init__(node, self.type, 'cmd_vel', lambda message: None, RELIABLE, is_stale)
        self.admit = self._deliver  # who admits a velocity takes it
        watch_types(node, self.type, 'cmd_vel')

    def _deliver(self, message: Any) -> bool:
        self.came_at = time.monotonic()
        age = self._age_of(message.header.stamp) if self.type is TwistStamped else 0.0
        return age is not None and self.on_velocity(to_velocity(message), age)

    def step(self) -> float:
        """
        Note a step in simulated time; return how long there was none [s of wall time].

        0 where that is not long, or a velocity came lately: somebody still wants it.
        """
        now = time.monotonic()
        gap = self._steps.beat(now)
        return gap if now - self.came_at > SHORTEST_ABSENCE else 0.0
