# SPDX-License-Identifier: Apache-2.0
"""
Goals on stairs of 15 cm, by sight, and on slopes, blind: a Go2 with `--map` in an unseen world.

Simulated: as in sight.py, and the planar lidar with its noise. The robot knows its odometry, its
map and, by sight, its elevation. A trunk that touches anything is a fall, however it goes on. On
slopes a blind robot may refuse a goal, but it has to know where it is.
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from table import format_count, Row
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

FIRST_SEED = 9200
STAND = '0.3 2\n2.8 5'
# A goal is looked for so often, and may take so long [s]; how near by the truth it is reached [m].
LOOK, PATIENCE, NEAR = 0.1, 90.0, 0.2
# How far the pose may be off in the end of a goal on a slope [m]: twice what a goal allows.
LOST = 0.1


class Case(NamedTuple):
    """Goals (x, y) [m], one after another."""

    name: str
    goals: tuple[tuple[float, float], ...]
    world: str = 'stairs:0.15'
    eyes: bool = True


CASES = (
    Case('on the landing', ((4.0, 0.0),)),
    Case('across: up, landing, down', ((8.6, 0.0),)),
    Case('on the landing, 1.5 m aside, and back', ((4.0, 1.5), (0.0, 0.0))),
)
SLOPES = tuple(
    Case(f'{angle} degrees', ((4.0, 0.0), (0.5, 0.0)), f'slope:{angle}', eyes=False)
    for angle in (5, 10, 15)
)


def drive(case: Case, seed: int) -> dict[str, Any]:
    """Drive to all goals of a case once; return what came of it."""
    run = Run(
        RunOptions(
            robot='go2',
            description='go2',
            preset='unitree',
            world=case.world,
            keys=tuple(parse_key_script(STAND, 'stand')),
            eyes=case.eyes,
            map='',
            goals=tuple((x, y, math.nan) for x, y in case.goals),
            speed=0.0,
            samples=True,
            seed=seed,
        )
    )
    try:
        ended: list[dict[str, Any]] = []
        while len(ended) < len(case.goals) and run.world.time < PATIENCE * len(case.goals):
            run.simulation.advance(round(LOOK / run.world.time_step))
            ended = run.navigations[0].report()['goals']
            if ended and ended[-1]['state'] != 'arrived':
                break
        falls = run.report()['falls']
        off = [math.dist(goal['truth'][:2], goal['goal'][:2]) for goal in ended]
        is_there = [goal['state'] == 'arrived' for goal in ended]
        return {
            'seed': seed,
            'passed': falls == 0
            and len(off) == len(case.goals)
            and all(is_there)
            and max(off) < NEAR,
            'falls': falls,
            'goals': ended,
            'off': off,
            'lost': max(
                (math.dist(goal['truth'][:2], goal['pose'][:2]) for goal in ended),
                default=math.inf,
            ),
            'time': run.world.time,
        }
    finally:
        run.close()


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure all cases."""
    count = 2 if quick else 20
    rows = []

    def drive_all(case: Case) -> list[dict[str, Any]]:
        trials = []
        for seed in range(FIRST_SEED, FIRST_SEED + count):
            note(f'{case.world}: {case.name}, seed {seed}')
            trials.append(drive(case, seed))
        return trials

    for case in CASES:
        trials = drive_all(case)
        good, falls = (sum(trial[key] for trial in trials) for key in ('passed', 'falls'))
        rows.append(
            Row(
                what=f'goals on stairs of 15 cm: {case.name}',
                measured=f'{format_count(good, count)}, {falls} falls',
                must=f'>= {count} of {count}, 0 falls',
                passed=good == count and falls == 0,
                trials=trials,
            )
        )
    for case in SLOPES:
        trials = drive_all(case)
        lost = [trial['lost'] for trial in trials]
        good = sum(error <= LOST for error in lost)
        arrived = sum(goal['state'] == 'arrived' for trial in trials for goal in trial['goals'])
        rows.append(
            Row(
                what=f'blind on a slope of {case.name}, up and back: pose known to {LOST:g} m',
                measured=f'{format_count(good, count)}, {max(lost):.3f} m at most, {arrived} of '
                f'{len(case.goals) * count} goals reached',
                must=f'>= {count} of {count}',
                passed=good == count,
                trials=trials,
            )
        )
    return rows
