# SPDX-License-Identifier: Apache-2.0
"""What is hard for the Go2: pushes, blind terrain, random commands, staying in place."""

from collections.abc import Sequence
from dataclasses import replace
import math

from experiment import Experiment
from experiment import Verdict
import numpy as np
from table import format_count
from trials import Run
from trials import START
from trials import Trace

GAIT_PERIOD = 0.45  # of a slow trot [s]
PHASES = 8
PUSHED = START + 3.0
PUSH_LASTS = 0.1
RECOVERY = 4.0
TERRAIN_TIME = 12.0  # at 0.5 m/s: 6 m, of which 0.8 are flat
TERRAIN_WAY = 4.0  # how far on x it must come [m]
COMMAND_LASTS = 2.0


TIMES = [PUSHED + GAIT_PERIOD * phase / PHASES for phase in range(PHASES)]


def push_runs(impulse: float, speed: float, seeds: Sequence[int]) -> list[Run]:
    """Return runs that push the trunk to the left, for each seed once in each part of the gait."""
    return [
        Run(
            seed=PHASES * (seed - seeds[0]) + seeds[0] + phase,
            twist=f'{START} {speed} 0 0\n',
            push=f'{time:.6f} 0 {impulse / PUSH_LASTS} 0 {PUSH_LASTS}',
            duration=math.ceil(PUSHED + GAIT_PERIOD + RECOVERY),
        )
        for seed in seeds
        for phase, time in enumerate(TIMES)
    ]


def pushes(impulse: float, seed: int) -> Experiment:
    """Push the trunk to the left while it trots at 0.5 m/s, once in each part of the gait."""
    runs = push_runs(impulse, 0.5, [seed])

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for phase, (trace, time) in enumerate(zip(traces, TIMES, strict=True)):
            rows = trace.after(time)
            roll = math.degrees(float(np.abs(trace.rpy[rows, 0]).max()))
            speed = float(trace.velocity[rows, 1].max())
            values = {'phase': phase / PHASES, 'roll_max_deg': roll, 'vy_max': speed}
            trials.append(trace.record(trace.is_up, **values))
        up = sum(trial['passed'] for trial in trials)
        roll = max(trial['roll_max_deg'] for trial in trials)
        measured = f'{format_count(up, len(trials))}, roll {roll:.0f} deg at worst'
        return Verdict(measured, up == len(trials), trials)

    return Experiment(
        what=f'lateral push {impulse:g} N s in 0.1 s at 0.5 m/s, {PHASES} gait phases',
        must=f'{PHASES} of {PHASES} survive',
        runs=runs,
        judge=judge,
        anchor='go2-convex-mpc: 0 of 1',
    )


def in_place(what: str, seeds: Sequence[int], step_in_place: bool) -> Experiment:
    """Trotting (key 4) with nothing commanded for 20 s: where the robot is in the end."""
    keys = '0.1 2\n2.6 4\n'
    begin = START + 1.0
    parameters = (('gait.step_in_place', step_in_place),)
    runs = [
        Run(seed=seed, keys=keys, duration=begin + 20.0, parameters=parameters) for seed in seeds
    ]

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            rows = trace.after(begin)
            place, yaw = trace.position[rows, :2], np.unwrap(trace.rpy[rows, 2])
            drift = 1e3 * float(np.linalg.norm(place - place[0], axis=1).max())
            turn = math.degrees(float(np.abs(yaw - yaw[0]).max()))
            passed = trace.is_up and drift <= 20.0 and turn <= 1.0
            values = {
                'drift_mm': drift,
                'yaw_deg': turn,
                'feet_down': float(trace.contacts[rows].mean()),
            }
            trials.append(trace.record(passed, **values))
        drift = max(trial['drift_mm'] for trial in trials)
        turn = max(trial['yaw_deg'] for trial in trials)
        feet = np.mean([trial['feet_down'] for trial in trials])
        measured = f'{drift:.1f} mm, {turn:.2f} deg, {100 * feet:.0f} % of feet down, '
        passed = all(trial['passed'] for trial in trials)
        return Verdict(f'{measured}n {len(trials)}', passed, trials)

    must = 'drift <= 20 mm, <= 1 deg'
    return Experiment(what=what, must=must, runs=runs, judge=judge)


def terrain(
    what: str,
    world: str,
    seeds: Sequence[int],
    share: float = 1.0,
    friction: float | None = None,
) -> Experiment:
    """Walk blindly at 0.5 m/s over a terrain; `share` of the seeds must come through."""
    twist = f'{START} 0.5 0 0\n'
    end = START + TERRAIN_TIME
    base = Run(seed=0, twist=twist, duration=end, world=world, friction=friction)
    runs = [replace(base, seed=seed) for seed in seeds]
    needed = math.ceil(share * len(runs) - 1e-9)

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            x, y, _ = trace.position[-1].tolist()
            tilt = math.degrees(float(np.abs(trace.rpy[:, :2]).max()))
            fell_at = trace.report['fell_at']
            values = {'x': x, 'y': y, 'tilt_max_deg': tilt, 'fell_at': fell_at}
            trials.append(trace.record(trace.is_up and x >= TERRAIN_WAY, **values))
        through = sum(trial['passed'] for trial in trials)
        return Verdict(format_count(through, len(trials)), through >= needed, trials)

    must = f'>= {needed} of {len(runs)}, {TERRAIN_WAY:g} m'
    return Experiment(what=what, must=must, runs=runs, judge=judge)


def random_commands(seeds: Sequence[int], seconds: float) -> Experiment:
    """A new random velocity every 2 s, zero now and then."""
    runs = [
        Run(seed=seed, twist=random_script(seed, seconds), duration=START + seconds)
        for seed in seeds
    ]

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = []
        for trace in traces:
            tilt = math.degrees(float(np.abs(trace.rpy[:, :2]).max()))
            fell_at = trace.report['fell_at']
            values = {'path': trace.path, 'tilt_max_deg': tilt, 'fell_at': fell_at}
            trials.append(trace.record(trace.is_up, **values))
        falls = sum(not trial['passed'] for trial in trials)
        metres = sum(trial['path'] for trial in trials)
        measured = f'{falls} falls in {len(trials)} x {seconds:g} s, {metres:.0f} m'
        return Verdict(measured, falls == 0, trials)

    what = 'random commands: vx -1..1.5, vy +-0.8 m/s, wz +-2 rad/s'
    return Experiment(what=what, must='0 falls', runs=runs, judge=judge)


def random_script(seed: int, seconds: float) -> str:
    """Return a --twist script of random velocities; one in seven is zero."""
    random = np.random.default_rng(seed)
    lines = []
    for index in range(math.ceil(seconds / COMMAND_LASTS)):
        velocity = random.uniform((-1.0, -0.8, -2.0), (1.5, 0.8, 2.0))
        velocity *= random.random() > 1.0 / 7.0
        numbers = ' '.join(f'{value:.4f}' for value in velocity)
        lines.append(f'{START + COMMAND_LASTS * index:.3f} {numbers}')
    return '\n'.join(lines) + '\n'
