# SPDX-License-Identifier: Apache-2.0
"""How well the Go2 stands, follows a velocity on the flat, and knows where it is."""

from collections.abc import Sequence
import math

from experiment import Experiment
from experiment import Verdict
import numpy as np
from table import format_count
from trials import Run
from trials import START
from trials import Trace

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

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            place = trace.position[trace.after(STAND_PRESSED + STAND_READY)]
            low, high = float(place[:, 2].min()), float(place[:, 2].max())
            drift = 1e3 * float(np.linalg.norm(place[:, :2] - place[0, :2], axis=1).max())
            torque = float(trace.torque.max())
            passed = low >= 0.31 and high <= 0.36 and drift <= 10.0 and torque <= 23.7
            values = {'lowest': low, 'highest': high, 'drift_mm': drift, 'torque_max': torque}
            trials.append(trace.record(passed and trace.report['falls'] == 0, **values))
        measured = (
            f'{min(t["lowest"] for t in trials):.3f}-{max(t["highest"] for t in trials):.3f} m, '
            f'{max(t["drift_mm"] for t in trials):.1f} mm, '
            f'{max(t["torque_max"] for t in trials):.1f} N m (any joint), n {len(trials)}'
        )
        return Verdict(measured, all(trial['passed'] for trial in trials), trials)

    return Experiment(
        what='stand: key 2 from lying, then 30 s',
        must='after 2.0 s 0.31-0.36 m, drift <= 10 mm, <= 23.7 N m',
        runs=runs,
        judge=judge,
        anchor='unitree_guide: 2.0 s',
    )


def constant(
    velocity: Velocity, seeds: Sequence[int], seconds: float, estimator: str = 'kalman'
) -> list[Run]:
    """Return runs that follow one velocity for so long [s]."""
    twist = f'{START} {velocity[0]} {velocity[1]} {velocity[2]}\n'
    end = START + seconds
    return [Run(seed=seed, twist=twist, duration=end, estimator=estimator) for seed in seeds]


def error_of(trace: Trace, velocity: Velocity) -> float:
    """Return the largest error of the mean velocity, of the axes commanded, as a share."""
    mean = trace.mean_velocity(START + SETTLE)
    return max(
        abs(float(mean[axis]) / wanted - 1.0) for axis, wanted in enumerate(velocity) if wanted
    )


def tracking(
    what: str, velocities: Sequence[Velocity], runs: Sequence[Run], limit: float, anchor: str = '-'
) -> Experiment:
    """Follow velocities; `runs` are as many for each, in order; `limit` is a share."""

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        each = len(traces) // len(velocities)
        for index, trace in enumerate(traces):
            wanted = velocities[index // each]
            error = error_of(trace, wanted)
            mean = trace.mean_velocity(START + SETTLE).tolist()
            names = dict(zip(('vx', 'vy', 'wz'), mean, strict=True))
            passed = trace.is_up and error <= limit
            command = ' '.join(map(str, wanted))
            trials.append(trace.record(passed, command=command, error=error, **names))
        worst = max(trial['error'] for trial in trials)
        up = format_count(sum(trace.is_up for trace in traces), len(traces))
        passed = all(trial['passed'] for trial in trials)
        return Verdict(f'{100 * worst:.1f} % at worst, {up} up', passed, trials)

    must = f'<= {100 * limit:g} %, no fall'
    return Experiment(what=what, must=must, runs=runs, judge=judge, anchor=anchor)


def steadiness(runs: Sequence[Run]) -> Experiment:
    """Judge how still the trunk is at 2 m/s."""

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            rows = trace.after(START + SETTLE)
            roll, pitch = np.degrees(trace.rpy[rows, :2].std(axis=0)).tolist()
            passed = trace.is_up and max(roll, pitch) <= 0.5
            trials.append(trace.record(passed, roll_std_deg=roll, pitch_std_deg=pitch))
        roll = max(trial['roll_std_deg'] for trial in trials)
        pitch = max(trial['pitch_std_deg'] for trial in trials)
        passed = all(trial['passed'] for trial in trials)
        return Verdict(f'roll {roll:.2f}, pitch {pitch:.2f} deg', passed, trials)

    return Experiment(
        what='trunk at 2.0 m/s, truth: standard deviation',
        must='<= 0.5 deg',
        runs=runs,
        judge=judge,
        anchor='go2-convex-mpc: 16 deg roll at 1.25 m/s',
    )


def cross_axis(velocity: Velocity, runs: Sequence[Run]) -> Experiment:
    """Judge the speed sideways that nobody asked for."""

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            sideways = float(trace.mean_velocity(START + SETTLE)[1])
            passed = trace.is_up and abs(sideways) <= 0.03
            trials.append(trace.record(passed, vy=sideways, error=error_of(trace, velocity)))
        worst = max(abs(trial['vy']) for trial in trials)
        passed = all(trial['passed'] for trial in trials)
        return Verdict(f'{worst:.3f} m/s at worst, n {len(trials)}', passed, trials)

    return Experiment(
        what='sideways at (0.5, 0, 0.5)',
        must='<= 0.03 m/s',
        runs=runs,
        judge=judge,
        anchor='grove-g1: 0.299 m/s',
    )


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
        worst = shares[-1] if shares else math.inf
        middle = shares[len(shares) // 2] if shares else math.inf
        metres = sum(trial['path'] for trial in trials)
        measured = (
            f'{100 * worst:.2f} % at worst, median {100 * middle:.2f} %: '
            f'{len(trials)} walks, {metres:.0f} m'
        )
        return Verdict(measured, worst <= 0.03, trials)

    return Experiment(
        what='odometry, of the path (all walks and terrains above)',
        must='<= 3 %',
        runs=runs,
        judge=judge,
        anchor='2602.17393: 1.8 % is next',
    )
