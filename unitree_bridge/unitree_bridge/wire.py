# SPDX-License-Identifier: Apache-2.0
"""What the interface is carried by, as its logic sees it: messages are bytes."""

from typing import Protocol

from unitree_bridge.topics import Topic


class Wire(Protocol):
    """Topics of which messages are taken and published; nothing here waits, but `wait`."""

    def publish(self, topic: Topic, raw: bytes) -> None:
        """Send a message to who listens now."""

    def is_heard(self, topic: Topic) -> bool:
        """Return whether somebody listens, as it was when `look` was called last."""

    def take(self, topic: Topic) -> list[bytes]:
        """Return the messages that have come, and no more than the topic keeps."""

    def sender(self, topic: Topic) -> int:
        """Return whose the message is that was taken last, a number."""

    def has_come(self, topics: tuple[Topic, ...]) -> bool:
        """Return whether there is a message of any of these topics."""

    def wait(self, topic: Topic, seconds: float) -> bool:
        """Wait for a message, at most so long [s of wall time]; return whether there is one."""

    def look(self) -> None:
        """Find out who listens."""

    def close(self) -> None:
        """Be gone for all others."""
