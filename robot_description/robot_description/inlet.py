# SPDX-License-Identifier: Apache-2.0
"""A subscription that may also be fed from inside the process."""

from collections import deque
from collections.abc import Callable
import time
from typing import Any, Generic, TypeVar

from rclpy.node import Node

Message = TypeVar('Message')

# How long the middleware may take to bring back what this process published itself [s].
ECHO_LIFETIME = 5.0


class Inlet(Generic[Message]):
    """
    A topic whose messages come from other processes and, handed over directly, from this one.

    Nodes that run in lock-step hand each message to the receiver in the same simulated instant, so
    that runs repeat; the same message is also published for everybody else, and the middleware
    brings it back to our own subscription. `put` is the hand-over and remembers the message;
    its echo is then dropped.
    """

    def __init__(
        self,
        node: Node,
        message_type: type[Message],
        topic: str,
        callback: Callable[[Message], None],
        depth: int = 10,
    ) -> None:
        self._callback = callback
        self._pending: deque[tuple[float, Message]] = deque(maxlen=1000)
        self._subscription: Any = node.create_subscription(
            message_type, topic, self._on_message, depth
        )

    def put(self, message: Message) -> None:
        """Hand over a message that this process is publishing, too."""
        self._pending.append((time.monotonic(), message))
        self._callback(message)

    def _on_message(self, message: Message) -> None:
        if not self._is_echo(message):
            self._callback(message)

    def _is_echo(self, message: Message) -> bool:
        oldest = time.monotonic() - ECHO_LIFETIME
        while self._pending and self._pending[0][0] < oldest:
            self._pending.popleft()
        for index, (_, sent) in enumerate(self._pending):
            if sent == message:
                # Echoes keep their order: whatever was sent before this one will not come back.
                for _ in range(index + 1):
                    self._pending.popleft()
                return True
        return False
