# SPDX-License-Identifier: Apache-2.0
"""A subscription that may also be fed from inside the process."""

from collections import deque
from collections.abc import Callable
import time
from typing import Any, ClassVar, Generic, TypeVar

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

from wasd_core.qos import EVENTS_DEPTH
from wasd_core.qos import RELIABLE

Message = TypeVar('Message')

# How long the middleware may take to bring back what this process published itself [s]. Under
# load, at --speed 0, a second of messages waits in its queues.
ECHO_LIFETIME = 10.0


class Inlet(Generic[Message]):
    """
    A topic whose messages come from other processes and, handed over directly, from this one.

    Nodes that run in lock-step hand each message to the receiver in the same simulated instant, so
    that runs repeat; the same message is also published for everybody else, and the middleware
    brings it back to our own subscription. `put` is the hand-over and remembers the message;
    its echo is then dropped.

    Echo and message are matched by their bytes, which are equal also where NaN is in them, and in
    the order in which they were put. An equal message from outside that overtakes an echo is
    dropped in its place, and the echo delivered: the receiver sees the same. An echo that gets
    lost is waited for up to ECHO_LIFETIME, or until a later one comes; so long, one equal message
    from outside may be taken for it. While nobody spins the node that time stands still: echoes
    are waiting, too.

    `is_stale` is asked about each message from another process, with the system time [ns] at
    which it was sent; what it calls stale is dropped.
    """

    # Told of every message that came from another process, and of the inlet that took it.
    witnesses: ClassVar[list[Callable[['Inlet[Any]', Any], None]]] = []

    def __init__(
        self,
        node: Node,
        message_type: type[Message],
        topic: str,
        callback: Callable[[Message], None],
        qos: QoSProfile = RELIABLE,
        is_stale: Callable[[int], bool] = lambda sent: False,
    ) -> None:
        self._callback = callback
        self._is_stale = is_stale
        self._pending: deque[tuple[float, bytes]] = deque(maxlen=EVENTS_DEPTH)
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

    def put(self, message: Message) -> None:
        """Hand over a message that this process is publishing, too."""
        self._pending.append((time.monotonic(), serialize_message(message)))
        self._callback(message)

    def witness(self, message: Any) -> None:
        """Tell the witnesses of a message that came from another process."""
        for tell in self.witnesses:
            tell(self, message)

    def _on_message(self, message: Message, info: dict[str, int]) -> None:
        if not self._is_echo(message) and not self._is_stale(info['source_timestamp']):
            self.witness(message)
            self._callback(message)

    def _is_echo(self, message: Message) -> bool:
        if not self._pending:
            return False
        received = serialize_message(message)
        for index, (_, sent) in enumerate(self._pending):
            if sent == received:
                # Echoes keep their order: whatever was sent before this one will not come back.
                for _ in range(index + 1):
                    self._pending.popleft()
                return True
        return False

    def _forget(self) -> None:
        """Give up echoes that were overdue at the last look already, and have not come since."""
        # Timers come before messages: an echo that is overdue now may be the next to be handled.
        oldest = self._looked_at - 0.5 * ECHO_LIFETIME
        while self._pending and self._pending[0][0] < oldest:
            self._pending.popleft()
        self._looked_at = time.monotonic()
