# SPDX-License-Identifier: Apache-2.0
"""How fast the Go2 is, how straight, at what cost; gaits; and what a payload takes away."""

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

from experiment import Experiment, judged, Trial, Verdict, worst
from go2_trouble import PHASES, push_runs
from go2_walks import constant, error_of, SETTLE, Velocity
import numpy as np
from trials import Run, START, Trace
from wasd_core.robot_io import GRAVITY

RACE = (('command.limits', 'race'),)
FAST = START + 5.0  # a ramp to 3 m/s takes 1.5 s, and a wobble some time to show [s]


def speed(
    what: str, velocity: Velocity, seeds: Sequence[int], parameters: tuple[Any, ...] = RACE
) -> Experiment:
    """Hold a velocity for 20 s: error, and how still the trunk is."""
    runs = [replace(run, parameters=parameters) for run in constant(velocity, seeds, 20.0)]

    def trial(trace: Trace) -> Trial:
        error = error_of(trace, velocity)
        roll, pitch = np.degrees(trace.rpy[trace.after(FAST), :2].std(axis=0)).tolist()
        passed = trace.is_up and error <= 0.05 and max(roll, pitch) <= 1.5
        return {'passed': passed, 'error': error, 'roll': roll, 'pitch': pitch}

    def say(trials: list[Trial]) -> str:
        errors = f'{100 * worst(trials, "error"):.1f} %'
        return f'{errors}, {worst(trials, "roll"):.1f} {worst(trials, "pitch"):.1f} deg at worst'

    return judged(what, '<= 5 %, std <= 1.5 deg', runs, trial, say)


def curve(velocity: Velocity, seeds: Sequence[int]) -> Experiment:
    """Drive a curve that may be slowed down as a whole: its shape, and no skid."""
    runs = [replace(run, parameters=RACE) for run in constant(velocity, seeds, 20.0)]
    asked = velocity[2] / math.hypot(*velocity[:2])

    def trial(trace: Trace) -> Trial:
        vx, vy, wz = trace.mean_velocity(FAST).tolist()
        skid = vy - float(trace.command[trace.after(FAST), 1].mean())
        error = abs(wz / max(math.hypot(vx, vy), 1e-6) / asked - 1.0)
        passed = trace.is_up and abs(skid) <= 0.1 and error <= 0.1
        return {'passed': passed, 'skid': abs(skid), 'error': error, 'vx': vx, 'vy': vy, 'wz': wz}

    def say(trials: list[Trial]) -> str:
        curved = f'{100 * worst(trials, "error"):.1f} % of the curve'
        return f'{worst(trials, "skid"):.3f} m/s sideways, {curved} at worst'

    what = f'curve of {velocity[0]:g}, {velocity[1]:g} m/s, {velocity[2]:g} rad/s'
    return judged(what, 'sideways <= 0.1 m/s, curve <= 10 %', runs, trial, say)


def transport(velocity: float, limit: float, seeds: Sequence[int]) -> Experiment:
    """Judge the work of the motors over weight and way, sum |torque x speed| / (m g d)."""
    runs = constant((velocity, 0.0, 0.0), seeds, 12.0)

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        rows = trace.after(START + SETTLE)
        energy = trace.felt.energy[rows]
        way = np.linalg.norm(np.diff(trace.position[rows, :2], axis=0), axis=1).sum()
        cost = float((energy[-1] - energy[0]) / (trace.felt.mass * GRAVITY * way))
        return {'passed': trace.is_up and cost <= limit, 'cost': cost}

    what = f'cost of transport at {velocity:g} m/s, mechanical'
    return judged(what, f'<= {limit:g}', runs, trial, lambda t: f'{worst(t, "cost"):.2f} at worst')


def touchdown(seeds: Sequence[int], limit: float = 0.5) -> Experiment:
    """Judge how fast feet come down in a trot of 1 m/s: the median of all steps."""
    runs = constant((1.0, 0.0, 0.0), seeds, 12.0)

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        times, speeds = trace.felt.touchdowns.T
        median = float(np.median(speeds[times > START + SETTLE]))
        return {'passed': trace.is_up and median <= limit, 'median': median}

    must = f'<= {limit:g} m/s'
    what = 'touch-down speed, trot at 1 m/s, median of the steps'
    return judged(what, must, runs, trial, lambda t: f'{worst(t, "median"):.3f} m/s at worst')


def gait(name: str, velocity: float, seeds: Sequence[int]) -> Experiment:
    """Walk in a gait for 10 s."""
    parameters = (('gait.name', name), *RACE)
    runs = [
        replace(run, parameters=parameters) for run in constant((velocity, 0.0, 0.0), seeds, 10.0)
    ]

    def trial(trace: Trace) -> Trial:
        error = error_of(trace, (velocity, 0.0, 0.0))
        return {'passed': trace.is_up and error <= 0.1, 'error': error}

    def say(trials: list[Trial]) -> str:
        return f'{100 * worst(trials, "error"):.1f} % at worst'

    return judged(f'gait {name}, {velocity:g} m/s', '<= 10 %', runs, trial, say)


def gait_switches(names: Sequence[str], seeds: Sequence[int], seconds: float) -> Experiment:
    """Change to another gait at random every 3 s at 0.5 m/s, by the key for the next one."""
    runs = [
        Run(
            seed=seed,
            twist=f'{START} 0.5 0 0\n',
            keys=switching_keys(names, seed, seconds),
            duration=START + seconds,
        )
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        return {'passed': trace.is_up, 'path': trace.path}

    what = f'gaits switched at random every 3 s for {seconds:g} s at 0.5 m/s'
    return judged(what, 'no fall', runs, trial, lambda t: f'{sum(r["path"] for r in t):.0f} m')


def switching_keys(names: Sequence[str], seed: int, seconds: float) -> str:
    """Return a --play script: `n` goes to the next gait of the table."""
    random = np.random.default_rng(seed)
    lines = ['0.1 2', '2.6 5']
    for index in range(1, int(seconds / 3.0)):
        presses = ' '.join('n' * int(random.integers(1, len(names))))
        lines.append(f'{START + 3.0 * index:.3f} {presses}')
    return '\n'.join(lines) + '\n'


LOADS = ((1.5, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 2.0))


def loaded(payload: str, impulse: float, seed: int) -> Experiment:
    """Compare speeds and pushes with a payload and without: none may lose over 5 %."""
    walks = [run for velocity in LOADS for run in constant(velocity, [seed], 10.0)]
    runs = [*walks, *push_runs(impulse, 0.5, [seed])]
    carrying = [replace(run, payload=payload) for run in runs]

    def judge(traces: Sequence[Trace]) -> Verdict:
        without, under = traces[: len(runs)], traces[len(runs) :]
        trials, shares = [], []
        for velocity, free, heavy in zip(LOADS, without, under, strict=False):
            axis = int(np.argmax(np.abs(velocity)))
            speeds = [float(one.mean_velocity(START + SETTLE)[axis]) for one in (free, heavy)]
            shares.append(speeds[1] / speeds[0] if free.is_up and heavy.is_up else 0.0)
            trials.append(heavy.record(shares[-1] >= 0.95, share=shares[-1], speed=speeds[1]))
        stood = [sum(trace.is_up for trace in part[-PHASES:]) for part in (without, under)]
        trials += [trace.record(trace.is_up) for trace in under[-PHASES:]]
        measured = f'speeds {100 * min(shares):.1f} % at worst, pushes {stood[1]} after {stood[0]}'
        passed = min(shares) >= 0.95 and stood[0] > 0 and stood[1] >= 0.95 * stood[0]
        return Verdict(f'{measured} of {PHASES}', passed, trials)

    return Experiment(
        what=f'payload {payload}: speeds, and pushes of {impulse:g} N s',
        must='no loss over 5 %',
        runs=[*runs, *carrying],
        judge=judge,
    )
