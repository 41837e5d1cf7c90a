# SPDX-License-Identifier: Apache-2.0
"""Schedules of velocities that others have published, scored as they score; none may fall."""

from collections.abc import Sequence

from experiment import Experiment, judged, Trial
from legs_speed import RACE
import numpy as np
from trials import Run, START, Trace

Velocity = tuple[float, float, float]
# From when on, which velocity ahead, to the left [m/s], and turn [rad/s].
Schedule = Sequence[tuple[float, Velocity]]
STAND: Velocity = (0.0, 0.0, 0.0)
# RoboGauge's commands: ahead and to the left [m/s], turn [rad/s], both ways.
AHEAD, LEFT, TURN = 2.0, 1.0, 2.0
# go2-convex-mpc's demo, 10 s.
DEMO: Schedule = (
    (0.0, (0.7, 0.0, 0.0)),
    (1.0, STAND),
    (1.5, (0.0, 0.3, 0.0)),
    (3.0, STAND),
    (4.0, (0.0, 0.0, 2.0)),
    (6.0, STAND),
    (6.5, (0.6, 0.0, 2.0)),
    (8.0, (0.8, 0.0, 0.0)),
    (9.0, STAND),
)


def most() -> tuple[Schedule, float]:
    """Return RoboGauge's goal `max_velocity`, 5 s each and 2 s standing, and how long it takes."""
    single = [sign * size * np.eye(3)[axis] for axis, size in enumerate((AHEAD, LEFT, TURN))
              for sign in (-1.0, 1.0)]  # fmt: skip
    found: list[tuple[float, Velocity]] = []
    for index, velocity in enumerate(single):
        vx, vy, wz = velocity.tolist()
        found += [(7.0 * index, (vx, vy, wz)), (7.0 * index + 5.0, STAND)]
    return found, 7.0 * len(single)


def diagonal() -> tuple[Schedule, float]:
    """Return RoboGauge's goal `diagonal_velocity`, 3 s each way, and how long it takes."""
    pairs = [(vx, vy) for vx in (-AHEAD, AHEAD, 0.0) for vy in (-LEFT, LEFT, 0.0) if vx or vy]
    found: list[tuple[float, Velocity]] = []
    for index, (vx, vy) in enumerate(pairs):
        found += [(6.0 * index, (vx, vy, 0.0)), (6.0 * index + 3.0, (-vx, -vy, 0.0))]
    return found, 6.0 * len(pairs)


def script(schedule: Schedule) -> str:
    """Return it as a --twist script."""
    return ''.join(
        f'{START + time:g} {" ".join(f"{value:g}" for value in velocity)}\n'
        for time, velocity in schedule
    )


def asked(trace: Trace, schedule: Schedule) -> np.ndarray:
    """Return what the schedule says at each row from its begin on, shape (n, 3)."""
    times = np.array([START + time for time, _ in schedule])
    rows = np.searchsorted(times, trace.t[trace.after(START)] + 1e-6, side='right') - 1
    return np.array([velocity for _, velocity in schedule])[rows]


def gauge(what: str, schedule: Schedule, seconds: float, seeds: Sequence[int]) -> Experiment:
    """
    Score a schedule as RoboGauge does: 1 less the mean error, as a share of the largest command.

    Its robot is put back to the start before each command; ours goes on.
    """
    runs = [
        Run(seed=seed, twist=script(schedule), duration=START + seconds, parameters=RACE)
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        error = trace.velocity[trace.after(START)] - asked(trace, schedule)
        linear = 1.0 - np.linalg.norm(error[:, :2], axis=1).mean() / np.hypot(AHEAD, LEFT)
        angular = 1.0 - np.abs(error[:, 2]).mean() / TURN
        return {'passed': trace.is_up, 'linear': float(linear), 'angular': float(angular)}

    def say(trials: list[Trial]) -> str:
        linear, angular = (np.mean([t[name] for t in trials]) for name in ('linear', 'angular'))
        return f'linear {linear:.3f}, angular {angular:.3f}'

    return judged(f'RoboGauge, {what}', 'no fall', runs, trial, say)


def demo(seeds: Sequence[int]) -> Experiment:
    """Follow go2-convex-mpc's demo; the errors are against our own ramps, as it has none."""
    runs = [Run(seed=seed, twist=script(DEMO), duration=START + 10.0) for seed in seeds]

    def trial(trace: Trace) -> Trial:
        rows = trace.after(START)
        error = trace.velocity[rows] - trace.command[rows]
        vx, vy, wz = np.sqrt((error**2).mean(axis=0)).tolist()
        return {'passed': trace.is_up, 'vx': vx, 'vy': vy, 'wz': wz}

    def say(trials: list[Trial]) -> str:
        vx, vy, wz = (np.mean([t[name] for t in trials]) for name in ('vx', 'vy', 'wz'))
        return f'RMSE {vx:.3f} {vy:.3f} m/s, {wz:.3f} rad/s'

    return judged("go2-convex-mpc's demo, 10 s", 'no fall', runs, trial, say)
