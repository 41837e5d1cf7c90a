# SPDX-License-Identifier: Apache-2.0
"""
What eyes cost: how fast time goes with them and without, how long a tick takes, what rays take.

All of it is CPU or wall time of this process: of a machine that does nothing else.
"""

from collections.abc import Callable
import statistics
import time
from typing import Any

import numpy as np
from table import Row
import wasd

SPEED, SEED = 0.4, 1  # [m/s]
WORLDS = ('flat', 'stairs:0.12')
# The one in which a tick is looked at: eyes are busiest on stairs that they can climb.
BUSIEST = 'stairs:0.15'
LEAST_SHARE = 0.6  # of the speed without eyes
LONGEST = 2.0  # of 99 ticks in a hundred [ms]
MOST_OF_A_CORE = 0.05  # for the rays of the lidar of points, in real time
WALK, PARTS = 3.0, 3  # simulated [s], and of so many the fastest counts


def walking(world: str, *, eyes: bool) -> Any:
    """Return a Go2 that walks straight ahead since a second."""
    dog = wasd.Go2(world, SEED, eyes=eyes)
    dog.press('2')
    dog.run(3.0)
    dog.press('5')
    dog.drive(SPEED)
    dog.run(1.0)
    return dog


def cpu_time(dog: Any) -> float:
    """Return how much CPU time a simulated second takes [s]."""
    times = []
    for _ in range(PARTS):
        before = time.process_time()
        dog.run(WALK)
        times.append(time.process_time() - before)
    return min(times) / WALK


def measure_cost(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure pairs by turns, ticks, and the lidar alone."""
    pairs = 1 if quick else 5
    note('sight: cost')
    return [*(_speed(world, pairs) for world in WORLDS), _tick(), _lidar(pairs)]


def _speed(world: str, pairs: int) -> Row:
    trials = []
    for _ in range(pairs):
        blind, eyes = (1.0 / cpu_time(walking(world, eyes=eyes)) for eyes in (False, True))
        trials.append({'world': world, 'blind': blind, 'eyes': eyes, 'share': eyes / blind})
    blind, eyes, share = (
        statistics.median(trial[key] for trial in trials) for key in ('blind', 'eyes', 'share')
    )
    return Row(
        what=f'eyes, {world}: real-time factor as a share of that without',
        measured=f'{100.0 * share:.0f} % ({eyes:.1f} of {blind:.1f}), {pairs} pairs',
        must=f'>= {100.0 * LEAST_SHARE:g} %',
        passed=share >= LEAST_SHARE,
        trials=trials,
    )


def _tick() -> Row:
    dog = walking(BUSIEST, eyes=True)
    period, times = dog._robot.period, []
    for _ in range(2500):
        before = time.perf_counter()
        dog.run(period)
        times.append(1e3 * (time.perf_counter() - before))
    middle, late, longest = np.percentile(times, (50, 99, 100))
    return Row(
        what=f'eyes, {BUSIEST}: a tick of {1e3 * period:g} ms with physics, rays and map, p99',
        measured=f'{late:.2f} ms (median {middle:.2f}, longest {longest:.2f})',
        must=f'<= {LONGEST:g} ms',
        passed=late <= LONGEST,
        trials=[{'ms': value} for value in times],
    )


def _lidar(pairs: int) -> Row:
    trials = []
    for _ in range(pairs):
        silent, heard = walking('flat', eyes=False), walking('flat', eyes=False)
        topics = heard._robot.sensors.topics
        next(t for t in topics if t.kind == 'PointCloud2').listen(lambda now, fields: None)
        trials.append({'share': cpu_time(heard) - cpu_time(silent)})
    share = statistics.median(trial['share'] for trial in trials)
    return Row(
        what='lidar of points that somebody hears: CPU time in real time',
        measured=f'{100.0 * share:.1f} % of a core, {pairs} pairs',
        must=f'<= {100.0 * MOST_OF_A_CORE:g} %',
        passed=share <= MOST_OF_A_CORE,
        trials=trials,
    )
