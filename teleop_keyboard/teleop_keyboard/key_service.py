# SPDX-License-Identifier: Apache-2.0
"""What `key_publisher` does beside publishing: keeps early keys, shows keys and state."""

import time
from typing import Any

from std_msgs.msg import String
from wasd_core.topics import LATCHED

from teleop_keyboard.waiting_keys import WaitingKeys


class KeyService:
    """
    Publishes the keys of a KeyPublisherNode once somebody listens to them.

    With a `help` it says that, the robot's state, and which keys wait.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._waiting = WaitingKeys()
        self._stepped_at = time.monotonic()
        self._is_talking = bool(node.help)
        if self._is_talking:
            print(node.help, flush=True)
            _subscribe_to_state(node)

    def press(self, key: str) -> None:
        """Publish a key, or keep it while nobody listens."""
        self.step()
        if self._node.has_subscriber:
            self._node.publish_key(key)
            return
        if not self._waiting:
            self._say(f'nobody listens to the keys yet: {key} waits')
        self._waiting.put(key)

    def step(self) -> None:
        """Publish what has waited, if somebody listens now; to be called all the time."""
        now = time.monotonic()
        late = self._waiting.step(now - self._stepped_at)
        self._stepped_at = now
        if late:
            self._say(f'nobody listens to the keys: {" ".join(late)} dropped')
        if self._waiting and self._node.has_subscriber:
            for key in self._waiting.take():
                self._node.publish_key(key)

    def _say(self, text: str) -> None:
        if self._is_talking:
            print(text, flush=True)


def _subscribe_to_state(node: Any) -> None:
    shown = ''

    def show(message: String) -> None:
        nonlocal shown
        if message.data != shown:
            shown = message.data
            print(f'state: {_one_line(shown)}', flush=True)

    node.create_subscription(String, 'state', show, LATCHED)


def _one_line(text: str) -> str:
    """Return a text of others without what a terminal would obey."""
    return ''.join(c if c.isprintable() else '?' for c in text)
