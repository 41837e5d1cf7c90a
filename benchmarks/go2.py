# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of the Go2: it stands, walks, is pushed, climbs, and keeps time.

Control runs on the estimator (`kalman`) unless the row says truth; what is measured is the
physics' truth. Everything but the last rows is simulated time, the same on every machine; seeds
begin at FIRST_SEED, which nobody tuned with.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
import subprocess
from typing import NamedTuple

from cores import simulate_all
from experiment import Experiment, FIRST_SEED, seeds
from go2_time import determinism, first_start, over_topics, slow_host, ticks
from go2_trouble import in_place, pushes, random_commands, terrain
from go2_walks import constant, cross_axis, odometry, stand, steadiness, tracking
from table import Row
from trials import RunFailed


class Sizes(NamedTuple):
    """How many seeds or runs of each kind, and how long random commands go on [s]."""

    speed: int
    others: int
    terrain: int
    random: int
    random_seconds: float
    timed: int


FULL = Sizes(speed=20, others=5, terrain=10, random=5, random_seconds=120.0, timed=3)
QUICK = Sizes(speed=2, others=1, terrain=2, random=1, random_seconds=60.0, timed=1)


def walks(sizes: Sizes) -> list[Experiment]:
    """Return the rows about following a velocity on the flat."""
    fast = constant((2.0, 0.0, 0.0), seeds(1), 20.0, 'truth')
    forward, left, turn = (1.5, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 2.0)
    tutorial = ((0.8, 0.0, 0.0), (0.0, 0.0, 0.8), (0.8, 0.0, 0.8))
    runs = [run for v in tutorial for run in constant(v, seeds(sizes.others), 10.0)]
    curve = (0.5, 0.0, 0.5)
    many = seeds(sizes.speed)
    return [
        stand(seeds(sizes.others)),
        tracking(
            'forward 2.0 m/s, truth, 20 s',
            fast,
            0.05,
            'go2-convex-mpc: 1.25 m/s',
        ),
        steadiness(fast),
        tracking('forward 1.5 m/s, 20 s', constant(forward, many, 20.0), 0.1, 'guide: 0.4'),
        tracking('lateral 0.8 m/s, 20 s', constant(left, many, 20.0), 0.1, 'guide: 0.3'),
        tracking('yaw 2.0 rad/s, 20 s', constant(turn, many, 20.0), 0.1, 'guide: 0.5'),
        tracking("the tutorial's go2.py: 0.8 m/s, 0.8 rad/s, both", runs, 0.05),
        cross_axis(curve, constant(curve, seeds(sizes.others), 10.0)),
    ]


def trouble(sizes: Sizes) -> list[Experiment]:
    """Return the rows about what may throw the robot over."""
    few, rough = seeds(sizes.others), seeds(sizes.terrain)
    return [
        pushes(15.0, FIRST_SEED),
        in_place('trot in place 20 s (step_in_place)', few, True),
        in_place('key 4, centred sticks 20 s (stands)', few, False),
        terrain('blind at 0.5 m/s: boxes up to 5 cm', 'boxes:0.05', rough),
        terrain('blind at 0.5 m/s: 15 degrees up', 'slope:15', rough),
        terrain('blind at 0.5 m/s: 15 degrees down', 'slope:-15', rough),
        terrain('blind at 0.5 m/s: one 8 cm step', 'step:0.08', rough, share=0.9),
        random_commands(seeds(sizes.random), sizes.random_seconds),
    ]


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Run everything and return the rows; `note` is told how far it is."""
    sizes = QUICK if quick else FULL
    moving: Sequence[Experiment] = [*walks(sizes), *trouble(sizes)]
    every = dict.fromkeys(run for part in moving for run in part.runs)
    experiments = [
        *moving,
        odometry([run for run in every if run.twist and run.estimator == 'kalman']),
        slow_host(FIRST_SEED, (0.2, 1.0, 0.0)),
        determinism(FIRST_SEED, 'boxes:0.05'),
    ]
    timed = on_the_clock(sizes, note)  # first, while the machine has nothing else to do
    results = simulate_all([run for part in experiments for run in part.runs], note)
    rows = [part.row(results) for part in experiments]
    return [replace(row, what=f'go2: {row.what}') for row in rows] + timed


def on_the_clock(sizes: Sizes, note: Callable[[str], None]) -> list[Row]:
    """Return the rows that depend on the machine, measured one after the other."""
    parts: dict[str, Callable[[], list[Row]]] = {
        'tick and real-time factor': lambda: ticks(FIRST_SEED, sizes.timed),
        'over topics': lambda: [over_topics(sizes.timed)],
        'first start': lambda: [first_start(sizes.timed)],
    }
    rows: list[Row] = []
    for name, part in parts.items():
        note(f'go2: {name}')
        try:
            rows += part()
        except (RunFailed, subprocess.SubprocessError) as error:
            broken = f'broke: {error}'
            rows.append(Row(what=f'go2: {name}', measured=broken, must='runs', passed=False))
    return rows
