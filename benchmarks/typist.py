# SPDX-License-Identifier: Apache-2.0
"""A keyboard's executable on a pseudo-terminal, which types and listens to what it publishes."""

from collections.abc import Callable
import os
import pty
import signal
import subprocess
import sys
import threading
import time

from geometry_msgs.msg import Twist
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

PATIENCE = 20.0


class Typist:
    """An executable on a pseudo-terminal, and ears for what it publishes."""

    def __init__(self, module: str) -> None:
        self.master, self.slave = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, '-m', module],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            start_new_session=True,
        )
        self.keys: list[float] = []
        self.moves: list[float] = []
        self.stops: list[float] = []
        self.node = rclpy.create_node('typist')
        self.node.create_subscription(String, 'keys', self._on_key, 100)
        self.node.create_subscription(Twist, 'cmd_vel', self._on_twist, 100)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._threads = [
            threading.Thread(target=self._executor.spin, daemon=True),
            threading.Thread(target=self._read_screen, daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def _on_key(self, message: String) -> None:
        self.keys.append(time.monotonic())

    def _on_twist(self, message: Twist) -> None:
        (self.moves if message.linear.x != 0.0 else self.stops).append(time.monotonic())

    def _read_screen(self) -> None:
        while True:
            try:
                os.read(self.master, 65536)
            except OSError:
                return

    def find_each_other(self) -> None:
        """Type a key that means nothing until it arrives."""
        deadline = time.monotonic() + PATIENCE
        while not self.keys:
            if time.monotonic() > deadline:
                raise RuntimeError('no key arrived')
            os.write(self.master, b'P')
            time.sleep(0.1)
        time.sleep(1.0)

    def latency(self, key: bytes, heard: Callable[[], list[float]], pause: float) -> float:
        """Return how long a key takes to be heard [s]; wait `pause` [s] before."""
        time.sleep(pause)
        heard().clear()
        typed = time.monotonic()
        os.write(self.master, key)
        while not heard():
            if time.monotonic() - typed > PATIENCE:
                raise RuntimeError(f'{key!r} was lost')
            time.sleep(0.0002)
        return heard()[0] - typed

    def close(self) -> None:
        """End it and release the terminal."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()
        self._executor.shutdown()
        self._threads[0].join()  # it waits in the executor; Python cannot end around it
        self.node.destroy_node()
        os.close(self.slave)
        self._threads[1].join()  # a descriptor's number is soon another's
        os.close(self.master)
