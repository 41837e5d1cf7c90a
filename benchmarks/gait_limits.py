# SPDX-License-Identifier: Apache-2.0
"""
What a gait can do ahead, sideways and turning at once: the ellipsoids of `GAITS`, and their proof.

`python benchmarks/gait_limits.py [GAIT ...]` tries them with seeds 1 and 2: of a gait's limits all
three at once it drives smaller and smaller shares, in ten directions, until nothing falls. It
prints that share, with the half axes of the ellipsoid through it, and its exit status is 1 when a
row of `GAITS` is not one tenth below that: where nothing falls with all three in full, the row
need not be below. Experiments of `wasd bench legs` then drive with other seeds what the rows
allow.
"""

import argparse
from collections.abc import Sequence
import itertools
import math
import sys

from experiment import Experiment, judged, Trial, worst
import numpy as np
from quadruped_sim.presets import GAITS
from trials import Run, START, Trace
import wasd

RACE = ('command.limits', 'race')
# Ahead or back, to either side, turning either way: which sticks are full; the rest is mirrored.
TWO = ((1, 1, 0), (-1, 1, 0), (1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, 1, -1))
DIRECTIONS = ((1, 1, 1), (1, 1, -1), (-1, 1, 1), (-1, 1, -1), *TWO)
SHARES = tuple(share / 20 for share in range(20, 9, -1))
FOUND_BY = (1, 2)
# A row's axes are written down so roughly [m/s], [rad/s].
ROUNDING = 0.05
# How long a run is driven: a bound takes 3.5 s to its full speed [s].
DRIVEN = 8.0
# More than any gait can: it is clamped [m/s], [rad/s].
FULL = 9.0


def full_sticks(gait: str, seeds: Sequence[int], limits: str = 'race') -> Experiment:
    """Drive all sticks full at once: it stays up, and on the course of its command."""
    runs = [
        Run(
            seed=seed,
            twist=f'{START} {" ".join(str(FULL * stick) for stick in sticks)}\n',
            duration=START + DRIVEN,
            parameters=(('gait.name', gait), ('command.limits', limits)),
        )
        for seed, sticks in zip(seeds, itertools.cycle(DIRECTIONS), strict=False)
    ]

    def trial(trace: Trace) -> Trial:
        rows = trace.after(START + 0.5 * DRIVEN)
        asked = trace.command[rows].mean(axis=0)
        off = np.abs(trace.velocity[rows].mean(axis=0) - asked)
        return {'passed': trace.is_up, 'off': float(off[:2].max()), 'turn': float(off[2])}

    def say(trials: list[Trial]) -> str:
        return f'{worst(trials, "off"):.2f} m/s, {worst(trials, "turn"):.2f} rad/s off at worst'

    return judged(f'gait {gait}, {limits}, sticks full at once', 'no fall', runs, trial, say)


def switched_at_speed(first: str, second: str, seeds: Sequence[int]) -> Experiment:
    """Choose another gait at full sticks, ahead or any way at once, and go on asking for it."""
    names = list(GAITS)
    keys = ' '.join('n' * ((names.index(second) - names.index(first)) % len(names)))
    runs = [
        Run(
            seed=seed,
            twist=f'{START} {" ".join(str(FULL * stick) for stick in sticks)}\n',
            keys=f'0.1 2\n2.6 5\n{START + 5.0 + 0.037 * (seed % 20):.3f} {keys}\n',
            duration=START + 12.0,
            parameters=(('gait.name', first), RACE),
        )
        for seed, sticks in zip(seeds, itertools.cycle(((1, 0, 0), *DIRECTIONS)), strict=False)
    ]
    what = f'gait {first} to {second} at full speed'
    return judged(what, 'no fall', runs, lambda trace: {'passed': trace.is_up})


def between_all(seeds: Sequence[int]) -> list[Experiment]:
    """Return the switches between any two gaits."""
    return [switched_at_speed(*pair, seeds) for pair in itertools.permutations(GAITS, 2)]


def stays_up(gait: str, sticks: Sequence[int], seed: int) -> bool:
    """Whether the robot does not fall with these sticks full, as the row of its gait allows."""
    dog = wasd.Go2(seed=seed, gait=gait, limits='race')
    dog.press('2')
    dog.run(2.2)
    dog.press('5')
    dog.run(0.4)
    dog.drive(*(FULL * stick for stick in sticks))
    dog.run(DRIVEN)
    return dog.state == 'move base'


def find(gait: str) -> bool:
    """Print the largest share with which nothing falls; return whether the row is below that."""
    row = GAITS[gait]
    corner = math.sqrt(3.0) * np.array((row.limits.forward, row.limits.lateral, row.limits.yaw))
    for share in SHARES:
        GAITS[gait] = row._replace(able=tuple(np.maximum(share * corner, 1e-3).tolist()))
        runs = itertools.product(FOUND_BY, DIRECTIONS)
        fall = next((run for run in runs if not stays_up(gait, run[1], run[0])), None)
        if fall is None:
            break
        print(f'{gait}, share {share:g}: sticks {fall[1]}, seed {fall[0]} fall', flush=True)
    else:
        share = 0.0
    GAITS[gait] = row
    axes = ', '.join(f'{axis:.2f}' for axis in share * corner)
    print(f'{gait}: share {share:g}, half axes {axes}; the row has {row.able}', flush=True)
    return share == 1.0 or bool(np.all(row.able <= 0.9 * share * corner + ROUNDING))


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('gait', nargs='*', help='default: all but the trot')
    names = parser.parse_args().gait or [name for name in GAITS if name != 'trot']
    wrong = [name for name in names if not find(name)]
    sys.exit(f'rows that promise too much: {", ".join(wrong)}' if wrong else 0)
