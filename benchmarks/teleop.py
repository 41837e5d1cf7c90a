# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of the keyboard: latency and idle cost on a real pseudo-terminal; a table and JSON.

Latency is from the write to the terminal to the callback of a subscriber in another process, for
keys typed one at a time. It needs an idle machine.
"""

from collections.abc import Callable
import json
import os
import pty
import random
import signal
import subprocess
import sys
import threading
import time

from environment import together
from geometry_msgs.msg import Twist
from mbot import cpu_time
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from table import at_most, Row

PATIENCE = 20.0
# Longer than a key counts after its press, so that each press starts a motion of its own [s].
PAUSE = 1.2


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
        if message.linear.x != 0.0:
            self.moves.append(time.monotonic())

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
        os.close(self.master)


def percentile(values: list[float], share: float) -> float:
    """Return the value that a share of all does not exceed."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def latency_row(what: str, values: list[float], limit: float, anchor: str) -> Row:
    """Return a row that passes when the 99th percentile of latencies [s] is not above a limit."""
    milliseconds = [1e3 * value for value in values]
    tail = percentile(milliseconds, 0.99)
    return Row(
        what=f'{what}, p99 of {len(values)}',
        measured=f'{tail:.2f} ms (median {percentile(milliseconds, 0.5):.2f})',
        must=f'<= {limit:g} ms',
        passed=tail <= limit,
        anchor=anchor,
        trials=[{'value': round(value, 3), 'unit': 'ms'} for value in milliseconds],
    )


def measure_executable(name: str, count: int, idle: float) -> list[Row]:
    """Measure one executable: latencies, and what it costs while nobody types."""
    typist = Typist(f'teleop_keyboard.{name}_node')
    generator = random.Random(1)
    try:
        typist.find_each_other()
        keys = [
            typist.latency(b'Q', lambda: typist.keys, generator.uniform(0.02, 0.06))
            for _ in range(5 * count)
        ]
        rows = [latency_row(f'{name}: key to keys', keys, 5.0, '-')]
        if name == 'teleop':
            moves = [
                typist.latency(b'i', lambda: typist.moves, PAUSE + generator.random() * 0.05)
                for _ in range(count)
            ]
            rows.append(
                latency_row(f'{name}: key to cmd_vel', moves, 25.0, '100 ms a loop: go2.py')
            )
        time.sleep(PAUSE)
        before = cpu_time(typist.process.pid)
        time.sleep(idle)
        used = 100 * (cpu_time(typist.process.pid) - before) / idle
        return [
            *rows,
            at_most(f'{name}: idle CPU', used, '% of a core', 2.0, 'key_publisher: 56-96'),
        ]
    finally:
        typist.close()


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of the keyboard."""
    words = ('20', '3') if quick else ('100', '10')
    rows: list[Row] = []
    for name in ('key_publisher', 'teleop'):
        note(f'keyboard: {name}')
        # A process of its own, because it has to hear the executable, and only that.
        done = subprocess.run(
            [sys.executable, __file__, name, *words],
            env=together(),
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        rows += [Row(**fields) for fields in json.loads(done.stdout)]
    return rows


def main(name: str, count: str, idle: str) -> None:
    """Measure one executable and print its rows as JSON."""
    rclpy.init()
    try:
        rows = measure_executable(name, int(count), float(idle))
    finally:
        rclpy.try_shutdown()
    print(json.dumps([vars(row) for row in rows]))


if __name__ == '__main__':
    main(*sys.argv[1:])
