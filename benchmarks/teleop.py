# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of the keyboard: latency and idle cost on a real pseudo-terminal; a table and JSON.

Latency is from the write to the terminal to the callback of a subscriber in another process, for
keys typed one at a time. It needs an idle machine.
"""

from collections.abc import Callable
import json
import random
import subprocess
import sys
import time

from environment import together
from mbot import cpu_time
import rclpy
from table import at_most, Row
from typist import Typist

# Longer than a key counts after its press, so that each press starts a motion of its own [s].
PAUSE = 1.2


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
