# SPDX-License-Identifier: Apache-2.0
"""From each state of the Go2's into each other one: at rest, driven, after a stop, pushed."""

from collections.abc import Sequence
import math
import random
from typing import NamedTuple

from experiment import Experiment, judged, Trial
from quadruped_sim.keys import keys_between, STATE_KEYS, StateName
from trials import Run, Trace

HOWS = ('at rest', 'driven at 0.5 m/s', 'stopped', 'pushed by 15 N s')
PUSH = 150.0  # for a tenth of a second [N]
# From any state to a stand, from a stand to a state, and how long the next one is looked at [s].
TO_STAND, TO_STATE, LOOKED_AT = 5.0, 3.0, 4.0
KEY_OF = {state: key for key, state in STATE_KEYS.items()}


class Tour(NamedTuple):
    """A run from one state into each other one; `times` are when it leaves for each [s]."""

    run: Run
    source: StateName
    times: dict[StateName, float]

    def pair_at(self, time: float) -> str:
        """Return the pair that was tried at a time [s]."""
        begun = [wanted for wanted, start in self.times.items() if start <= time]
        return f'{self.source.value} to {begun[-1].value if begun else "nothing yet"}'


def tour(source: StateName, how: str, seed: int) -> Tour:
    """Return the run from a state into all others, standing up between them."""
    chance = random.Random(f'{source} {how} {seed}')
    keys, twists, pushes, times, now = [], ['0 0 0 0'], [], {}, 0.2
    for wanted in (state for state in StateName if state is not source):
        for key, wait in _ways_to(source):
            keys.append(f'{now:.3f} {key}')
            now += wait
        if how in HOWS[1:3]:
            keys.append(f'{now:.3f} w*5')
            twists.append(f'{now:.3f} 0.5 0 0')
            now += 2.5
        if how == HOWS[2]:
            keys.append(f'{now:.3f} SPACE')
            twists.append(f'{now:.3f} 0 0 0')
            now += 0.7
        if how == HOWS[3]:
            angle = chance.uniform(-math.pi, math.pi)
            x, y = PUSH * math.cos(angle), PUSH * math.sin(angle)
            pushes.append(f'{now:.3f} {x:.1f} {y:.1f} 0 0.1')
            now += 0.1 + chance.uniform(0.0, 0.5)
        times[wanted] = now
        for key in keys_between(source, wanted):
            keys.append(f'{now:.3f} {key}')
            now += 0.02
        now += LOOKED_AT
    run = Run(
        seed=seed,
        keys='\n'.join(keys) + '\n',
        twist='\n'.join(twists) + '\n',
        push=';'.join(pushes),
        duration=now,
    )
    return Tour(run, source, times)


def _ways_to(source: StateName) -> list[tuple[str, float]]:
    """Return the keys that lead into a state from any, and how long to wait after each [s]."""
    stand = ('2', TO_STAND)
    if source is StateName.PASSIVE:
        return [stand, ('7', TO_STATE)]
    if source is StateName.GET_UP:
        return [stand, ('7', TO_STATE), ('6', 0.5 * TO_STATE)]
    return [stand] if source is StateName.FIXED_STAND else [stand, (KEY_OF[source], TO_STATE)]


def pairs(how: str, seeds: Sequence[int]) -> Experiment:
    """Go from each state into each other one; nothing falls, whatever follows whatever."""
    tours = [tour(source, how, seed) for seed in seeds for source in StateName]
    by_run = {tried.run: tried for tried in tours}

    def trial(trace: Trace) -> Trial:
        fell_at = trace.report['fell_at']
        where = '' if fell_at is None else by_run[trace.run].pair_at(fell_at)
        return {'passed': fell_at is None, 'from': by_run[trace.run].source.value, 'pair': where}

    def say(trials: list[Trial]) -> str:
        return ', '.join(sorted({found['pair'] for found in trials} - {''}))

    runs = [tried.run for tried in tours]
    return judged(f'each state into each other: {how}', '0 falls', runs, trial, say)
