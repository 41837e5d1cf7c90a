# SPDX-License-Identifier: Apache-2.0
"""How well the Go2 stands, follows a velocity on the flat, and knows where it is."""

from collections.abc import Sequence
import math

from experiment import Experiment, judged, Trial, Verdict, worst
import numpy as np
from table import format_count
from trials import Run, START, Trace

Velocity = tuple[float, float, float]

# From the first velocity until the speed counts: the ramp to 2 m/s takes 1 s [s].
SETTLE = 3.0
STAND_PRESSED = 0.1
STAND_READY = 2.0  # unitree_guide's fixed stand takes so long [s]
# Shorter ways say nothing about a share of the way [m].
SHORTEST_PATH = 2.0


def stand(seeds: Sequence[int]) -> Experiment:
    """Key 2 from lying: height after 2 s and from then on, drift in 30 s, peak torque."""
    runs = [Run(seed=seed, keys=f'{STAND_PRESSED} 2\n', duration=32.1) for seed in seeds]

    def trial(trace: Trace) -> Trial:
        place = trace.position[trace.after(STAND_PRESSED + STAND_READY)]
        low, high = float(place[:, 2].min()), float(place[:, 2].max())
        drift = 1e3 * float(np.linalg.norm(place[:, :2] - place[0, :2], axis=1).max())
        torque = float(trace.torque.max())
        passed = low >= 0.31 and high <= 0.36 and drift <= 10.0 and torque <= 23.7
        passed = passed and trace.report['falls'] == 0
        values = {'lowest': low, 'highest': high, 'drift_mm': drift, 'torque_max': torque}
        return {'passed': passed, **values}

    def say(trials: list[Trial]) -> str:
        lowest = min(found['lowest'] for found in trials)
        return (
            f'{lowest:.3f}-{worst(trials, "highest"):.3f} m, '
            f'{worst(trials, "drift_mm"):.1f} mm, '
            f'{worst(trials, "torque_max"):.1f} N m (any joint), n {len(trials)}'
        )

    return judged(
        'stand: key 2 from lying, then 30 s',
        'after 2.0 s 0.31-0.36 m, drift <= 10 mm, <= 23.7 N m',
        runs,
        trial,
        say,
        share=None,
        anchor='unitree_guide: 2.0 s',
    )


def constant(
    velocity: Velocity, seeds: Sequence[int], seconds: float, estimator: str = 'kalman'
) -> list[Run]:
    """Return runs that follow one velocity for so long [s]."""
    twist = f'{START} {velocity[0]} {velocity[1]} {velocity[2]}\n'
    end = START + seconds
    return [Run(seed=seed, twist=twist, duration=end, estimator=estimator) for seed in seeds]


def error_of(trace: Trace, velocity: Sequence[float]) -> float:
    """Return the largest error of the mean velocity, of the axes commanded, as a share."""
    mean = trace.mean_velocity(START + SETTLE)
    return max(
        abs(float(mean[axis]) / wanted - 1.0) for axis, wanted in enumerate(velocity) if wanted
    )


def tracking(what: str, runs: Sequence[Run], limit: float, anchor: str = '-') -> Experiment:
    """Follow the velocity of each run; `limit` is a share."""

    def trial(trace: Trace) -> Trial:
        _, *wanted = map(float, trace.run.twist.split())
        error = error_of(trace, wanted)
        mean = trace.mean_velocity(START + SETTLE).tolist()
        names = dict(zip(('vx', 'vy', 'wz'), mean, strict=True))
        command = ' '.join(map(str, wanted))
        passed = trace.is_up and error <= limit
        return {'passed': passed, 'command': command, 'error': error, **names}

    def say(trials: list[Trial]) -> str:
        up = format_count(sum(found['up'] for found in trials), len(trials))
        return f'{100 * worst(trials, "error"):.1f} % at worst, {up} up'

    must = f'<= {100 * limit:g} %, no fall'
    return judged(what, must, runs, trial, say, share=None, anchor=anchor)


def steadiness(runs: Sequence[Run]) -> Experiment:
    """Judge how still the trunk is at 2 m/s."""

    def trial(trace: Trace) -> Trial:
        rows = trace.after(START + SETTLE)
        roll, pitch = np.degrees(trace.rpy[rows, :2].std(axis=0)).tolist()
        passed = trace.is_up and max(roll, pitch) <= 0.5
        return {'passed': passed, 'roll_std_deg': roll, 'pitch_std_deg': pitch}

    def say(trials: list[Trial]) -> str:
        roll, pitch = (worst(trials, f'{axis}_std_deg') for axis in ('roll', 'pitch'))
        return f'roll {roll:.2f}, pitch {pitch:.2f} deg'

    what = 'trunk at 2.0 m/s, truth: standard deviation'
    anchor = 'go2-convex-mpc: 16 deg roll at 1.25 m/s'
    return judged(what, '<= 0.5 deg', runs, trial, say, share=None, anchor=anchor)


def cross_axis(velocity: Velocity, runs: Sequence[Run]) -> Experiment:
    """Judge the speed sideways that nobody asked for."""

    def trial(trace: Trace) -> Trial:
        sideways = float(trace.mean_velocity(START + SETTLE)[1])
        passed = trace.is_up and abs(sideways) <= 0.03
        return {'passed': passed, 'vy': sideways, 'error': error_of(trace, velocity)}

    def say(trials: list[Trial]) -> str:
        sideways = max(abs(found['vy']) for found in trials)
        return f'{sideways:.3f} m/s at worst, n {len(trials)}'

    what, anchor = 'sideways at (0.5, 0, 0.5)', 'grove-g1: 0.299 m/s'
    return judged(what, '<= 0.03 m/s', runs, trial, say, share=None, anchor=anchor)


def odometry(runs: Sequence[Run]) -> Experiment:
    """Judge where odometry says the robot has gone, in every walk long enough."""

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            if trace.path < SHORTEST_PATH or not trace.is_up:
                continue
            share = trace.odometry_error / trace.path
            values = {'path': trace.path, 'error': trace.odometry_error, 'share': share}
            trials.append(trace.record(share <= 0.03, **values))
        shares = sorted(trial['share'] for trial in trials)
        largest = shares[-1] if shares else math.inf
        middle = shares[len(shares) // 2] if shares else math.inf
        metres = sum(trial['path'] for trial in trials)
        measured = (
            f'{100 * largest:.2f} % at worst, median {100 * middle:.2f} %: '
            f'{len(trials)} walks, {metres:.0f} m'
        )
        return Verdict(measured, largest <= 0.03, trials)

    return Experiment(
        what='odometry, of the path (all walks and terrains above)',
        must='<= 3 %',
        runs=runs,
        judge=judge,
        anchor='2602.17393: 1.8 % is next',
    )
