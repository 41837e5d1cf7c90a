# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of what the Go2's legs can do at most: speed, pushes, ground, ice, states, gaits.

Control runs on the Kalman filter with the drifting IMU; what is measured is the physics' truth.
Seeds begin at FIRST_SEED, which nobody tuned with.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from cores import simulate_all
from experiment import Experiment, FIRST_SEED, seeds
from gait_limits import between_all, full_sticks
from go2_trouble import random_runs, terrain
from legs_ground import (
    climbing,
    differing,
    height,
    jumping_and_thrown,
    known,
    patch,
    pushed,
    running,
    slippery,
    THROW_EVERY,
    to_and_fro,
)
from legs_speed import curve, gait, gait_switches, loaded, speed, touchdown, transport
from legs_states import get_up, jump, monkey, swing
from quadruped_sim.presets import GAITS, LIMITS
import schedules
from state_pairs import HOWS, pairs
from table import Row

SPEEDS = {
    'forward 3.0 m/s, 20 s': (3.0, 0.0, 0.0),
    'backward 2.0 m/s, 20 s': (-2.0, 0.0, 0.0),
    'lateral 1.5 m/s, 20 s': (0.0, 1.5, 0.0),
    'yaw 5 rad/s, 20 s': (0.0, 0.0, 5.0),
}
GAIT_SPEEDS = {
    'walk': 0.5,
    'trot': 3.0,
    'pace': 0.8,
    'bound': 1.15,
    'pronk': 1.0,
    'gallop': 2.5,
}
# Both ends of jump.height with both ends of jump.distance, and none [m].
JUMPS = ((0.05, -0.075), (0.05, 0.0), (0.05, 0.15), (0.2, -0.25), (0.2, 0.0), (0.2, 0.5))


class Sizes(NamedTuple):
    """How many seeds of each kind, and how long random ways are [s]."""

    many: int
    gaits: int
    pushes: int
    tumbled: int
    differing: int
    switches: int
    way: float
    minute: float


FULL = Sizes(20, 10, 3, 100, 100, 5, way=600.0, minute=60.0)
QUICK = Sizes(1, 1, 1, 3, 2, 1, way=60.0, minute=20.0)


def fast(gait: str) -> bool:
    """Whether the usual limits are stricter than those of a gait."""
    return GAITS[gait].limits.forward > LIMITS['sport'].forward


def on_the_flat(sizes: Sizes) -> list[Experiment]:
    """Return the rows about speed, curves, cost, gaits and published schedules."""
    many, few = seeds(sizes.many), seeds(sizes.gaits)
    return [
        *(speed(what, velocity, many) for what, velocity in SPEEDS.items()),
        curve((2.0, 0.0, 2.0), many),
        curve((1.5, 0.8, 2.0), many),
        *(transport(at, limit, few) for at, limit in ((0.5, 0.45), (1.0, 0.6), (2.0, 0.9))),
        touchdown(few),
        *(gait(name, GAIT_SPEEDS[name], few) for name in GAITS),
        *(full_sticks(name, many) for name in GAITS),
        *(full_sticks(name, many, 'sport') for name in GAITS if fast(name)),
        *between_all(many),
        gait_switches(list(GAITS), seeds(sizes.switches), 2.0 * sizes.minute),
        schedules.gauge('max_velocity', *schedules.most(), seeds(sizes.switches)),
        schedules.gauge('diagonal_velocity', *schedules.diagonal(), seeds(sizes.switches)),
        schedules.demo(few),
    ]


def in_trouble(sizes: Sizes) -> list[Experiment]:
    """Return the rows about pushes, ground that is not seen, ice, and what nobody tells."""
    many, pushing = seeds(sizes.many), seeds(sizes.pushes)
    climbs = (('25 degrees up', 'slope:25'), ('25 degrees down', 'slope:-25'))
    return [
        pushed(35.0, 0.5, pushing, 1.0),
        pushed(40.0, 0.5, pushing, 20.0 / 24.0),
        pushed(30.0, 1.5, pushing, 22.0 / 24.0),
        pushed(30.0, 0.5, pushing, 0.95, gait='walk'),
        terrain('blind at 0.5 m/s: one 12 cm step', 'step:0.12', many, share=0.9),
        terrain('blind at 0.5 m/s: stairs of 10 cm', 'stairs:0.1', many),
        terrain('blind at 0.5 m/s: stairs of 12 cm', 'stairs:0.12', many, share=0.9),
        terrain('blind at 0.5 m/s: boxes up to 12 cm', 'boxes:0.12', many),
        *(
            terrain(f'blind at 0.5 m/s: {what}, friction 0.8', world, many, friction=0.8)
            for what, world in climbs
        ),
        slippery(0.25, many),
        patch(0.2, 1.0, many, 0.9),
        loaded('8@0,0.1,0', 35.0, FIRST_SEED),
        differing(seeds(sizes.differing), sizes.minute),
    ]


def of_states(sizes: Sizes) -> list[Experiment]:
    """Return the rows about getting up, jumping, and any state after any other."""
    many = seeds(sizes.many)
    return [
        get_up('any pose, flat', 'flat', 0.0, seeds(sizes.tumbled)),
        get_up('any pose, boxes of 5 cm', 'boxes:0.05', 3.0, many),
        get_up('any pose, slope of 10 degrees', 'slope:10', 3.0, many),
        jump('in place', 'v', 0.0, many),
        jump('ahead', 'v', 0.4, many, distance=0.45),
        *(
            jump(f'{up:g} m high, {on:g} m ahead', 'v', None, many, height=up, distance=on)
            for up, on in JUMPS
        ),
        monkey('begun at a trot', seeds(sizes.tumbled), sizes.minute),
        *(monkey(f'begun at a {name}', many, sizes.minute, gait=name) for name in list(GAITS)[1:]),
        monkey('boxes of 5 cm', many, sizes.minute, world='boxes:0.05'),
        *(swing(at, turn, many) for at in (0.3, 0.5, 0.8) for turn in (0.0, 0.6)),
        *(pairs(how, seeds(sizes.pushes)) for how in HOWS),
    ]


def of_odometry(sizes: Sizes) -> list[Experiment]:
    """Return the rows about where the robot believes it is."""
    many, few = seeds(sizes.many), seeds(sizes.switches)
    far = f'random commands, {sizes.way / 60.0:g} min'
    long = max(sizes.way, THROW_EVERY)
    falls = int(long / THROW_EVERY)
    ways = (7.0, -6.0, 6.0, -6.0, 6.0, -6.0)
    thrown = f'{2 * falls} jumps, {falls} throws in {long / 60.0:g} min'
    return [
        known(far, random_runs(few, sizes.way), 0.005, 0.05),
        *(
            known(f'{at:g} m/s straight ahead', running(at, few), 0.02, 0.05)
            for at in (1.0, 2.0, 3.0)
        ),
        known('stairs of 10 cm', climbing('stairs:0.1', many), 0.02, None),
        known('20 degrees up', climbing('slope:20', many), 0.02, None),
        height(thrown, jumping_and_thrown(few, long), 0.05, thrown=falls),
        height('boxes of 10 cm, 10 m', to_and_fro('boxes:0.1', many, (7.5, -2.5)), 0.05),
        *(
            height(f'{angle} degrees, 37 m to and fro', to_and_fro(slope, many, ways), share=0.01)
            for angle, slope in ((15, 'slope:15'), (-15, 'slope:-15'))
        ),
    ]


# Parts of the names of rows to be measured; none means all.
only: list[str] = []


def experiments(quick: bool, *texts: str) -> list[Experiment]:
    """Return all experiments, or those whose names contain one of some texts."""
    sizes = QUICK if quick else FULL
    parts = [*on_the_flat(sizes), *in_trouble(sizes), *of_states(sizes), *of_odometry(sizes)]
    return [part for part in parts if not texts or any(text in part.what for text in texts)]


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Run everything that is chosen and return the rows; `note` is told how far it is."""
    parts = experiments(quick, *only)
    results = simulate_all([run for part in parts for run in part.runs], note)
    rows = [part.row(results) for part in parts]
    return [replace(row, what=f'legs: {row.what}') for row in rows]
