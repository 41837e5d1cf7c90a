# SPDX-License-Identifier: Apache-2.0
"""
How fast programs of Unitree's SDK are served: run it on an idle machine, with the SDK installed.

    .venv/bin/python benchmarks/unitree_latency.py [SECONDS] [DOMAIN]

A program answers each LowState with a LowCmd that names its tick. Printed are how many LowStates
were told and heard, how long it takes until the command is in force, how busy a core is, how long
a call takes, and how soon a program that starts hears its first LowState.
"""

import json
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

import numpy as np
from unitree_bridge.cdr import Layout
from unitree_bridge.connection import open_wire
from unitree_bridge.shapes import LOW_CMD, LOW_STATE
from unitree_bridge.simulated import ALL_INTO, ALL_OUT, Scene, SimulatedGo2
from unitree_bridge.topics import Topic
from unitree_bridge.wire import Wire

from unitree_bridge import topics

PROGRAMS = Path(__file__).parents[1] / 'tests/unitree_sdk_programs.py'
TICK, ANSWERED = Layout(LOW_STATE).field('tick'), Layout(LOW_CMD).field('reserve')


class Watched:
    """A wire on which it is noted when LowStates go and when the commands are taken."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self.sent: dict[int, float] = {}
        self.trips: list[float] = []

    def __getattr__(self, name: str) -> Any:
        """Do all else as the wire does."""
        return getattr(self._wire, name)

    def publish(self, topic: Topic, raw: bytes) -> None:
        """Note when a LowState goes."""
        if topic.name == topics.LOW_STATE.name:
            self.sent[int(TICK.of(raw)[0])] = time.perf_counter()
        self._wire.publish(topic, raw)

    def take(self, topic: Topic) -> list[bytes]:
        """Note how long ago the LowState went that a command answers."""
        taken = self._wire.take(topic)
        if topic.name == topics.LOW_CMD.name:
            now = time.perf_counter()
            ticks = [int(ANSWERED.of(raw)[0]) for raw in taken]
            self.trips += [now - self.sent[tick] for tick in ticks if tick in self.sent]
        return taken


def serve(go2: SimulatedGo2, domain: int, *words: str) -> dict[str, Any]:
    """Simulate until a program of the SDK has ended; return what it saw."""
    command = [sys.executable, PROGRAMS, str(domain), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        go2.run(lambda: program.poll() is not None)
        assert program.stdout is not None
        seen: dict[str, Any] = json.loads(program.stdout.read().splitlines()[-1])
    return seen


def main() -> None:
    """Simulate so long [s] and print what was measured."""
    seconds, domain = float((sys.argv[1:] or ['60'])[0]), int((sys.argv[2:] or ['0'])[0])
    wire = Watched(open_wire(domain, 'lo', ALL_OUT, ALL_INTO))
    go2 = SimulatedGo2(Scene(), wire, print)
    began, spent = time.perf_counter(), time.process_time()
    heard = serve(go2, domain, 'round_trip', str(seconds))['heard']
    wall, spent = time.perf_counter() - began, time.process_time() - spent
    p50, p90, p99, most = 1e3 * np.percentile(wire.trips, (50, 90, 99, 100))
    share = f'{spent / wall:.2f} of a core for robot and interface'
    print(f'real-time factor {go2.world.time / wall:.3f}, {share}')
    print(f'LowStates: {len(wire.sent)} told while somebody listened, {heard} heard')
    trips = f'p50 {p50:.2f}, p90 {p90:.2f}, p99 {p99:.2f}, max {most:.1f}'
    print(f'until the command is in force [ms]: {trips}; it is looked for every 2 ms')
    took = 1e3 * np.array(serve(go2, domain, 'calls')['took'])
    middle, worst = np.median(took), took.max()
    print(f'{len(took)} calls of the sport service [ms]: p50 {middle:.2f}, max {worst:.1f}')
    found = serve(go2, domain, 'stand_by_motors')['discovery']
    print(f'a program hears its first LowState {found:.2f} s after it has asked')
    go2.close()


if __name__ == '__main__':
    main()
