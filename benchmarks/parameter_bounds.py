# SPDX-License-Identifier: Apache-2.0
"""
Every parameter of the leg controller at the ends of its range, and anywhere in it, set in a trot.

    python benchmarks/parameter_bounds.py [--seeds N] [--first SEED] [--inner N] [NAME ...]

The Go2 trots at 0.5 m/s and turns; then one parameter is set. It goes on, turns at 1 m/s, stands
still, is told to stand, and trots again. It must be up at the end, without a fall. The items of a
list are set all to one end, and each alone. Ranges were found with the seeds from 1 on; those from
FIRST_SEED on judge them. Parameters that go together badly are looked for by `--sets N`: all
parameters anywhere in their ranges at once.
"""

import argparse
from collections.abc import Iterator
import math
import random
import sys
from typing import Any

from experiment import FIRST_SEED
from quadruped_sim.parameters import LegControllerParameters
from trials import Run, simulate, Trace
from wasd_core.parameters import known_parameters, numeric_ends

# What is done with the parameter: a trot in which it is set, a faster one, a stand, a trot.
SET_AT = 3.6
KEYS = '0.1 2\n2.6 5\n7.0 2\n7.8 5\n'
TWIST = '3.0 0.5 0 0.8\n4.2 1.0 0 1.0\n6.3 0 0 0\n8.0 0.8 0 -0.6\n'
DURATION = 9.3
# A Go2 that walks like this has not fallen, but it soon will [deg], [m].
TILTED, LOW = 25.0, 0.12

# How it jumps shows in jumps: legs_states.py.
KNOWN = {
    name: known
    for name, known in known_parameters(LegControllerParameters).items()
    if known.group != 'jump'
}


def ends_of(name: str) -> dict[str, Any]:
    """Return the values at the ends of a parameter's range, by what they are called."""
    field = KNOWN[name].field
    if isinstance(field.default, bool):
        return {'false': False, 'true': True}
    if isinstance(field.default, str):
        return {choice: choice for choice in field.metadata['choices']}
    ends = dict(zip(('low', 'high'), numeric_ends(field), strict=True))
    if not isinstance(field.default, tuple):
        return ends
    for end, values in list(ends.items()):
        for index, value in enumerate(values):
            alone = list(field.default)
            alone[index] = value
            ends[f'{end} [{index}]'] = tuple(alone)
    return ends


def drawn(name: str, chance: random.Random) -> Any:
    """Return a value anywhere in a parameter's range."""
    field = KNOWN[name].field
    if isinstance(field.default, (bool, str)):
        return chance.choice(list(ends_of(name).values()))
    low, high = numeric_ends(field)
    if isinstance(field.default, tuple):
        return tuple(chance.uniform(*pair) for pair in zip(low, high, strict=True))
    return (
        chance.randint(low, high) if isinstance(field.default, int) else chance.uniform(low, high)
    )


def trial(seed: int, *settings: tuple[str, Any]) -> Run:
    """Return a run in which parameters are set one after the other, at once."""
    tunes = tuple((SET_AT, name, value) for name, value in settings)
    return Run(seed=seed, keys=KEYS, twist=TWIST, duration=DURATION, tunes=tunes)


def verdict(trace: Trace) -> str:
    """Return what is wrong with a walk, '' if nothing is."""
    rows = trace.after(SET_AT)
    tilt = math.degrees(float(abs(trace.rpy[rows, :2]).max()))
    assert trace.felt is not None
    height = float(trace.felt.clearance[rows].min())
    if not trace.is_up or 'passive' in trace.state[rows]:
        return f'FELL: ends {trace.state[-1]} with {trace.report["falls"]} falls'
    if tilt > TILTED or height < LOW:
        return f'near: tilts {tilt:.0f} deg, {100 * height:.0f} cm high'
    return ''


def judged(run: Run) -> str:
    """Return what is wrong with a run, '' if nothing is."""
    try:
        return verdict(simulate(run))
    except Exception as error:  # an experiment that looks for just those goes on
        return f'BROKE: {type(error).__name__}: {error}'


def walks(names: list[str], seeds: list[int], inner: int) -> Iterator[tuple[str, Run]]:
    """Yield every trial with what it is called."""
    for name in names:
        values = ends_of(name)
        chance = random.Random(f'{name} {seeds[0]}')
        values |= {f'inside {n}': drawn(name, chance) for n in range(inner)}
        for what, value in values.items():
            for seed in seeds:
                yield f'{name} {what} = {value} seed {seed}', trial(seed, (name, value))


def sets(count: int, first: int) -> Iterator[tuple[str, Run]]:
    """Yield trials of all parameters at once, anywhere in their ranges."""
    for seed in range(first, first + count):
        chance = random.Random(seed)
        settings = [(name, drawn(name, chance)) for name in KNOWN]
        yield f'set {seed}', trial(seed, *settings)


def main() -> int:
    """Run what is asked for; print what fails, and the sums."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('names', nargs='*', help='parts of names of parameters; none: all')
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--first', type=int, default=FIRST_SEED)
    parser.add_argument('--inner', type=int, default=0, help='values anywhere in the range')
    parser.add_argument('--sets', type=int, default=0, help='all parameters at once, so often')
    asked = parser.parse_args()
    names = [n for n in KNOWN if not asked.names or any(part in n for part in asked.names)]
    seeds = list(range(asked.first, asked.first + asked.seeds))
    trials = sets(asked.sets, asked.first) if asked.sets else walks(names, seeds, asked.inner)
    count = bad = 0
    for what, run in trials:
        found, count = judged(run), count + 1
        if found:
            bad += not found.startswith('near')
            print(f'{what}: {found}', flush=True)
    print(f'{count - bad} of {count} held')
    return int(bad > 0)


if __name__ == '__main__':
    sys.exit(main())
