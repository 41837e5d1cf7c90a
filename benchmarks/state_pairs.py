# SPDX-License-Identifier: Apache-2.0
"""
From each state of the Go2's into each other one: at rest, driven at 0.5 m/s, after a stop, pushed.

`python benchmarks/state_pairs.py [HOW ...]` tries them and writes docs/state_pairs.md.
"""

import argparse
from collections.abc import Sequence
import datetime
import json
import math
from pathlib import Path
import random
from typing import Any, NamedTuple

from cores import simulate_all
from experiment import Experiment, judged, seeds, Trial
from quadruped_sim.keys import keys_between, STATE_KEYS, StateName, SUCCESSORS, TRANSITIONS
from trials import Run, Trace

HOWS = ('at rest', 'driven at 0.5 m/s', 'stopped', 'pushed by 15 N s')
PUSH = 150.0  # for a tenth of a second [N]
# From any state to a stand, from a stand to a state, and how long the next one is looked at [s].
TO_STAND, TO_STATE, LOOKED_AT = 3.5, 2.5, 3.0
# How long the sticks lean a robot, and a velocity drives one [s].
LEANT, DRIVEN = 0.5, 2.5
DRIVES = (StateName.TROTTING, StateName.MOVE_BASE)
# A policy's state needs a network, whose steps are its own.
STATES = tuple(state for state in StateName if state is not StateName.POLICY)
KEY_OF = {state: key for key, state in STATE_KEYS.items()}
DOCS = Path(__file__).resolve().parents[1] / 'docs'
RESULT, PAGE = DOCS / 'state_pairs.json', DOCS / 'state_pairs.md'
HEAD = """# Transitions between all states

`python benchmarks/state_pairs.py` writes this page: tries without a fall, of all tries, within
{looked:g} s after the keys that lead from the row's state to the column's. If a state ends
by itself, the keys interrupt it in the middle where they can.

"""


class Tour(NamedTuple):
    """A run from one state into each other one; `times` are when it leaves for each [s]."""

    run: Run
    source: StateName
    times: dict[StateName, float]

    def pair_at(self, time: float) -> str:
        """Return the pair that was tried at a time [s]."""
        begun = [wanted for wanted, start in self.times.items() if start <= time]
        return f'{self.source.value} to {begun[-1].value if begun else "nothing yet"}'


def tour(source: StateName, how: str, seed: int, into: Sequence[StateName] = STATES) -> Tour:
    """Return the run from a state into all others, or some, standing up between them."""
    chance = random.Random(f'{source} {how} {seed}')
    keys, twists, pushes, times, now = [], ['0 0 0 0'], [], {}, 0.2
    for wanted in (state for state in into if state is not source):
        for key, wait in _ways_to(source, wanted, chance):
            keys.append(f'{now:.3f} {key}')
            now += wait
        if how in HOWS[1:3]:
            keys.append(f'{now:.3f} w*5')
            twists.append(f'{now:.3f} 0.5 0 0')
            now += DRIVEN if source in DRIVES else LEANT
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


def _ways_to(
    source: StateName, wanted: StateName, chance: random.Random
) -> list[tuple[str, float]]:
    """Return the keys that lead into a state from any, and how long to wait after each [s]."""
    stand = ('2', TO_STAND)
    if source is StateName.FIXED_STAND:
        return [stand]
    lie = [stand, (KEY_OF[StateName.LIE_DOWN], TO_STATE)]
    if source is StateName.PASSIVE:
        return lie
    ways = lie if source is StateName.GET_UP else [stand]
    is_left_midway = keys_between(source, wanted)[:1] in [(key,) for key in TRANSITIONS[source]]
    midway = source in SUCCESSORS and is_left_midway
    return [*ways, (KEY_OF[source], chance.uniform(0.1, 1.2) if midway else TO_STATE)]


def pairs(how: str, seeds: Sequence[int]) -> Experiment:
    """Go from each state into each other one; nothing falls, whatever follows whatever."""
    tours = [tour(source, how, seed) for seed in seeds for source in STATES]
    by_run = {tried.run: tried for tried in tours}

    def trial(trace: Trace) -> Trial:
        fell_at = trace.report['fell_at']
        where = '' if fell_at is None else by_run[trace.run].pair_at(fell_at)
        return {'passed': fell_at is None, 'from': by_run[trace.run].source.value, 'pair': where}

    def say(trials: list[Trial]) -> str:
        return ', '.join(sorted({found['pair'] for found in trials} - {''}))

    runs = [tried.run for tried in tours]
    return judged(f'each state into each other: {how}', '0 falls', runs, trial, say)


def counts(trials: Sequence[Trial]) -> dict[str, list[int]]:
    """Return of each pair how often it held and was tried; what follows a fall is not counted."""
    found: dict[str, list[int]] = {}
    for trial in trials:
        for wanted in STATES:
            pair = f'{trial["from"]} to {wanted.value}'
            if wanted.value == trial['from']:
                continue
            held, tried = found.get(pair, [0, 0])
            found[pair] = [held + (pair != trial['pair']), tried + 1]
            if pair == trial['pair']:
                break
    return found


def page(result: dict[str, Any]) -> str:
    """Return the page of a result: of each way the date, the seeds and what `counts` returns."""
    lines = []
    for how in HOWS:
        if (found := result.get(how)) is None:
            lines.append(f'- {how}: not tried')
            continue
        held, tried = (sum(count[k] for count in found['pairs'].values()) for k in (0, 1))
        seen = f'seeds from {found["seeds"][0]} on, {len(found["seeds"])} of each, {found["date"]}'
        lines.append(f'- {how}: {held} of {tried} ({seen})')
    lines += ['', f'| from, to | {" | ".join(STATES)} |', '|---' * (len(STATES) + 1) + '|']
    for source in STATES:
        cells = [_cell(result, f'{source.value} to {wanted.value}') for wanted in STATES]
        lines.append(f'| {source.value} | {" | ".join(cells)} |')
    return HEAD.format(looked=LOOKED_AT) + '\n'.join(lines) + '\n'


def _cell(result: dict[str, Any], pair: str) -> str:
    seen = [found['pairs'][pair] for found in result.values() if pair in found['pairs']]
    held, tried = (sum(count[k] for count in seen) for k in (0, 1))
    return f'{held}/{tried}' if tried else '-'


def main() -> None:
    """Measure, and write the page and what it is made of."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('how', nargs='*', metavar='HOW', help=f'default: all of {HOWS}')
    parser.add_argument('--seeds', type=int, default=1, help='how many of each (default: 1)')
    arguments = parser.parse_args()
    if unknown := set(arguments.how) - set(HOWS):
        parser.error(f'{min(unknown)!r}: wanted one of {HOWS}')
    tried = seeds(arguments.seeds)
    result = json.loads(RESULT.read_text()) if RESULT.exists() else {}
    for how in arguments.how or HOWS:
        experiment = pairs(how, tried)
        row = experiment.row(simulate_all(experiment.runs, lambda _: None))
        print(f'{row.what}: {row.measured}', flush=True)
        result[how] = {
            'date': datetime.date.today().isoformat(),
            'seeds': list(tried),
            'pairs': counts(row.trials),
        }
        RESULT.write_text(json.dumps(result, indent=1) + '\n')
        PAGE.write_text(page(result))


if __name__ == '__main__':
    main()
