# SPDX-License-Identifier: Apache-2.0
"""
How fast programs of Unitree's SDK are served: run it on an idle machine, with the SDK installed.

    .venv/bin/python benchmarks/unitree_latency.py [SECONDS] [DOMAIN]

A program answers each LowState with a LowCmd that names its tick. Printed are how many LowStates
were heard and lost, how long it takes until the command is here and in force, how much of a core
the interface takes, how long a call takes, and how soon a program that starts hears its first
LowState.
"""

import argparse
from collections.abc import Callable
import contextlib
import json
from pathlib import Path
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
from unitree_bridge.cdr import Layout
from unitree_bridge.connection import open_wire
from unitree_bridge.shapes import LOW_CMD, LOW_STATE
from unitree_bridge.simulated import ALL_INTO, ALL_OUT, SimulatedGo2
from unitree_bridge.topics import Topic
from unitree_bridge.wire import Wire

from unitree_bridge import topics

# For how long the robot is alone, and a program commands it, while CPU time is measured [s].
ALONE, SERVED = 10.0, 20.0
PROGRAMS = Path(__file__).parents[1] / 'tests/unitree_sdk_programs.py'
TICK, ANSWERED = Layout(LOW_STATE).field('tick'), Layout(LOW_CMD).field('reserve')


class Share:
    """
    What the interface costs of a core: the bridge's steps, and all threads of Cyclone DDS.

    What simulates beside it is not counted.
    """

    def __init__(self, go2: SimulatedGo2) -> None:
        self._world, bridge = go2.world, go2.bridge
        self._step, bridge.step = bridge.step, self._timed  # type: ignore[method-assign]
        self._spent = 0.0

    def _timed(self, dt: float) -> None:
        self._world.read()  # as our controller does in each instant, with the bridge or without
        began = time.thread_time()
        self._step(dt)
        self._spent += time.thread_time() - began

    def of(self, run: Callable[[], object]) -> float:
        """Return the share of a core while something runs."""
        began, spent = time.perf_counter(), self._total()
        run()
        return (self._total() - spent) / (time.perf_counter() - began)

    def _total(self) -> float:
        return self._spent + time.process_time() - time.thread_time()


class Watched:
    """A wire on which it is noted when LowStates go, and when commands come and are taken."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self.sent: dict[int, float] = {}
        self.trips: list[float] = []
        self.ways: list[float] = []
        self._came, self._is_taken, self._is_over = 0.0, threading.Event(), False
        threading.Thread(target=self._await, daemon=True).start()

    def _await(self) -> None:
        """Note when a command comes that is not taken yet."""
        has_come = False
        while not self._is_over:
            with contextlib.suppress(KeyError):  # the wire is closed
                has_come = self._wire.wait(topics.LOW_CMD, 0.1)
            if has_come:
                self._came = time.perf_counter()
                self._is_taken.clear()
                self._is_taken.wait(0.1)

    def close(self) -> None:
        """Be gone, as the wire is."""
        self._is_over = True
        self._wire.close()

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
            now, came = time.perf_counter(), self._came
            sent = [self.sent.get(int(ANSWERED.of(raw)[0]), now) for raw in taken]
            self.trips += [now - at for at in sent]
            self.ways += [came - at for at in sent if came > at]
            self._is_taken.set()
        return taken


def in_words(times: list[float]) -> str:
    """Return shares of times [s] in words, in milliseconds."""
    p50, p90, p99, most = 1e3 * np.percentile(times, (50, 90, 99, 100))
    return f'p50 {p50:.2f}, p90 {p90:.2f}, p99 {p99:.2f}, max {most:.1f}'


def serve(go2: SimulatedGo2, domain: int, *words: str) -> dict[str, Any]:
    """Simulate until a program of the SDK has ended; return what it saw."""
    command = [sys.executable, str(PROGRAMS), str(domain), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        go2.run(lambda: program.poll() is not None)
        assert program.stdout is not None
        seen: dict[str, Any] = json.loads(program.stdout.read().splitlines()[-1])
    return seen


def count(domain: int, seconds: float) -> None:
    """Print how many LowStates come within so long [s], and how many between them do not."""
    kept = topics.LOW_STATE._replace(depth=10**6)
    wire = open_wire(domain, 'lo', (), (kept,))
    time.sleep(seconds)
    ticks = np.array([int(TICK.of(raw)[0]) for raw in wire.take(kept)])
    print(len(ticks), int((np.diff(ticks) // 2 - 1).sum()))
    wire.close()


def say_share(domain: int) -> None:
    """Print what the interface costs, alone and with a program, while nothing else is measured."""
    go2 = SimulatedGo2(open_wire(domain, 'lo', ALL_OUT, ALL_INTO), print)
    share = Share(go2)
    alone = share.of(lambda: go2.run(lambda: False, go2.world.time + ALONE))
    served = share.of(lambda: serve(go2, domain, 'round_trip', str(SERVED)))
    print(f'the interface: {served:.3f} of a core, {alone:.3f} while nobody listens')
    go2.close()


def main() -> None:
    """Simulate so long [s] and print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('seconds', type=float, nargs='?', default=60.0, help='default: 60')
    parser.add_argument('domain', type=int, nargs='?', default=0, help='of DDS; default: 0')
    arguments = parser.parse_args()
    seconds, domain = arguments.seconds, arguments.domain
    say_share(domain)
    wire = Watched(open_wire(domain, 'lo', ALL_OUT, ALL_INTO))
    go2 = SimulatedGo2(wire, print)
    go2.run(lambda: False, go2.world.time + 1.0)
    began, simulated = time.perf_counter(), go2.world.time
    with subprocess.Popen(
        [sys.executable, __file__, 'count', str(domain), str(seconds)], stdout=subprocess.PIPE
    ) as counter:
        seen = serve(go2, domain, 'round_trip', str(seconds))
        assert counter.stdout is not None
        came, lost = map(int, counter.stdout.read().split())
    wall = time.perf_counter() - began
    rate = (seen['heard'] + seen['missed'] - 1) / seen['seconds']
    print(f'real-time factor {(go2.world.time - simulated) / wall:.3f}')
    print(f'LowStates: {rate:.2f} a second of wall time, {lost} of {came} lost on the way')
    print(f'... of which the SDK, whose reader has room for one, missed {seen["missed"]}')
    print(f'from a LowState until its command is here [ms]: {in_words(wire.ways)}')
    print(f'... and in force: {in_words(wire.trips)}; it is looked for every 2 ms')
    took = 1e3 * np.array(serve(go2, domain, 'calls')['took'])
    middle, worst, quick = np.median(took), took.max(), (took <= 5.0).sum()
    print(
        f'{len(took)} calls of the sport service [ms]: p50 {middle:.2f}, max {worst:.1f}, '
        f'{quick} within 5'
    )
    found = serve(go2, domain, 'stand_by_motors')['discovery']
    print(f'a program hears its first LowState {found:.2f} s after it has asked')
    go2.close()


if __name__ == '__main__':
    if sys.argv[1:2] == ['count']:
        count(int(sys.argv[2]), float(sys.argv[3]))
    else:
        main()
