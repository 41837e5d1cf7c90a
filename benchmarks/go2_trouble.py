# SPDX-License-Identifier: Apache-2.0
"""What is hard for the Go2: pushes, blind terrain, random commands, staying in place."""

from collections.abc import Sequence
from dataclasses import replace
import math

from experiment import Experiment, judged, Trial, worst
import numpy as np
from quadruped_sim.presets import GAITS
from trials import Run, START, Trace

GAIT_PERIOD = 0.45  # of a slow trot [s]
PHASES = 8
PUSHED = START + 3.0
PUSH_LASTS = 0.1
RECOVERY = 4.0
TERRAIN_TIME = 12.0  # at 0.5 m/s: 6 m, of which 0.8 are flat
TERRAIN_WAY = 4.0  # how far on x it must come [m]
COMMAND_LASTS = 2.0


def push_runs(impulse: float, speed: float, seeds: Sequence[int], gait: str = 'trot') -> list[Run]:
    """Return runs that push the trunk to the left, for each seed once in each part of the gait."""
    period = GAIT_PERIOD * GAITS[gait].period
    return [
        Run(
            seed=PHASES * (seed - seeds[0]) + seeds[0] + phase,
            twist=f'{START} {speed} 0 0\n',
            push=f'{PUSHED + period * phase / PHASES:.6f} 0 {impulse / PUSH_LASTS} 0 {PUSH_LASTS}',
            duration=math.ceil(PUSHED + period + RECOVERY),
            parameters=(('gait.name', gait),) if gait != 'trot' else (),
        )
        for seed in seeds
        for phase in range(PHASES)
    ]


def pushes(impulse: float, seed: int) -> Experiment:
    """Push the trunk to the left while it trots at 0.5 m/s, once in each part of the gait."""
    runs = push_runs(impulse, 0.5, [seed])

    def trial(trace: Trace) -> Trial:
        time = float(trace.run.push.split()[0])
        rows = trace.after(time)
        roll = math.degrees(float(np.abs(trace.rpy[rows, 0]).max()))
        speed = float(trace.velocity[rows, 1].max())
        phase = round((time - PUSHED) / GAIT_PERIOD, 3)
        return {'passed': trace.is_up, 'phase': phase, 'roll': roll, 'vy_max': speed}

    def say(trials: list[Trial]) -> str:
        return f'roll {worst(trials, "roll"):.0f} deg at worst'

    what = f'lateral push {impulse:g} N s in 0.1 s at 0.5 m/s, {PHASES} gait phases'
    return judged(what, 'survives', runs, trial, say, anchor='go2-convex-mpc: 0 of 1')


def in_place(what: str, seeds: Sequence[int], step_in_place: bool) -> Experiment:
    """Trotting (key 4) with nothing commanded for 20 s: where the robot is in the end."""
    keys = '0.1 2\n2.6 4\n'
    begin = START + 1.0
    parameters = (('gait.step_in_place', step_in_place),)
    runs = [
        Run(seed=seed, keys=keys, duration=begin + 20.0, parameters=parameters) for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        rows = trace.after(begin)
        place, yaw = trace.position[rows, :2], np.unwrap(trace.rpy[rows, 2])
        drift = 1e3 * float(np.linalg.norm(place - place[0], axis=1).max())
        turn = math.degrees(float(np.abs(yaw - yaw[0]).max()))
        passed = trace.is_up and drift <= 20.0 and turn <= 1.0
        down = float(trace.contacts[rows].mean())
        return {'passed': passed, 'drift_mm': drift, 'yaw_deg': turn, 'feet_down': down}

    def say(trials: list[Trial]) -> str:
        feet = 100 * np.mean([found['feet_down'] for found in trials])
        drift, turn = worst(trials, 'drift_mm'), worst(trials, 'yaw_deg')
        return f'{drift:.1f} mm, {turn:.2f} deg, {feet:.0f} % of feet down, n {len(trials)}'

    return judged(what, 'drift <= 20 mm, <= 1 deg', runs, trial, say, share=None)


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

    def trial(trace: Trace) -> Trial:
        x, y, _ = trace.position[-1].tolist()
        return {'passed': trace.is_up and x >= TERRAIN_WAY, 'x': x, 'y': y, 'tilt': trace.tilt}

    return judged(what, f'{TERRAIN_WAY:g} m', runs, trial, share=share)


def random_commands(seeds: Sequence[int], seconds: float) -> Experiment:
    """A new random velocity every 2 s, zero now and then."""

    def trial(trace: Trace) -> Trial:
        return {'passed': trace.is_up, 'path': trace.path, 'tilt': trace.tilt}

    def say(trials: list[Trial]) -> str:
        falls = sum(not found['passed'] for found in trials)
        metres = sum(found['path'] for found in trials)
        return f'{falls} falls in {len(trials)} x {seconds:g} s, {metres:.0f} m'

    what = 'random commands: vx -1..1.5, vy +-0.8 m/s, wz +-2 rad/s'
    return judged(what, '0 falls', random_runs(seeds, seconds), trial, say, share=None)


def random_runs(seeds: Sequence[int], seconds: float) -> list[Run]:
    """Return runs of random commands on the flat, for so long [s]."""
    return [
        Run(seed=seed, twist=random_script(seed, seconds), duration=START + seconds)
        for seed in seeds
    ]


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
