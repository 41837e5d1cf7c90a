# SPDX-License-Identifier: Apache-2.0
"""
How a policy walks: `wasd bench policy [FILE [CONFIG]]`; without a file, ours.

What `wasd.Go2` simulates, with noise and drift of sensors and a delay of 2 ms, on flat ground. The
robot stands, plays the policy, and is told a velocity; what counts is its true velocity, averaged
from `SETTLE` on, and whether it was up all the time.
"""

from collections.abc import Callable
import math
from typing import Any

from experiment import Trial
import numpy as np
from policy_speed import measure_speed
from table import format_count, Row
import wasd

FIRST_SEED = 12000  # those of clone_policy.py end before
chosen = ['ours']
SECONDS, SETTLE = 20.0, 4.0
ERROR = 0.15
WALKS = (
    ('0.5 m/s', (0.5, 0.0, 0.0)),
    ('1 m/s', (1.0, 0.0, 0.0)),
    ('0.5 rad/s', (0.0, 0.0, 0.5)),
)
IMPULSE, PUSH_LASTS = 20.0, 0.1
Velocity = tuple[float, float, float]


def drive(
    seed: int, velocity: Velocity, seconds: float = SECONDS, impulse: float = 0.0
) -> dict[str, Any]:
    """
    Return how a policy followed a velocity [m/s], [m/s], [rad/s] for so long [s].

    An `impulse` [N s] pushes the trunk to the left, at a time within 0.4 s that follows from the
    seed: the gait of ours.
    """
    config = chosen[1] if len(chosen) > 1 else None
    dog = wasd.Go2(seed=seed, policy=chosen[0], policy_config=config)
    dog.press('2')
    dog.run(2.5)
    dog.press('p')
    dog.run(1.5)
    dog.drive(*velocity)
    begun, found = dog.time, []
    pushed = math.inf if not impulse else SETTLE + 0.02 * (7 * seed % 20)
    while dog.time - begun < seconds - 1e-6 and dog.state == 'policy':
        if dog.time - begun >= pushed - 1e-6:
            dog.push((0.0, impulse / PUSH_LASTS, 0.0), PUSH_LASTS)
            pushed = math.inf
        dog.run(0.02)
        found.append(dog.truth.planar_velocity)
    lasted = dog.time - begun
    mean = np.mean(found[round(SETTLE / 0.02) :] or [np.zeros(3)], axis=0)
    asked = float(np.linalg.norm(velocity))
    off = mean - velocity
    # Sideways drift counts where it walks, any drift where it turns, both as m/s per m/s or rad/s.
    error = float(np.linalg.norm(off)) / asked
    return {
        'seed': seed, 'up': dog.state == 'policy', 'lasted': lasted, 'error': error,
        'vx': float(mean[0]), 'vy': float(mean[1]), 'wz': float(mean[2]),
    }  # fmt: skip


def walk(name: str, velocity: Velocity, seeds: range, note: Callable[[str], None]) -> Row:
    """Follow a velocity."""
    trials: list[Trial] = []
    for seed in seeds:
        note(f'policy, {name}, seed {seed}')
        trial = drive(seed, velocity)
        trials.append({**trial, 'passed': trial['up'] and trial['error'] <= ERROR})
    passed = sum(trial['passed'] for trial in trials)
    mean = np.mean([[trial[axis] for axis in ('vx', 'vy', 'wz')] for trial in trials], axis=0)
    worst = max(trial['error'] for trial in trials)
    told = f'{mean[0]:.3f}, {mean[1]:+.3f} m/s, {mean[2]:+.3f} rad/s'
    return Row(
        what=f'policy {chosen[0]}: {name} for {SECONDS:g} s',
        measured=f'{format_count(passed, len(trials))}, {told}, {100 * worst:.0f} % at worst',
        must=f'up, error <= {100 * ERROR:.0f} %: {len(trials)} of {len(trials)}',
        passed=passed == len(trials),
        trials=trials,
    )


def push(seeds: range, note: Callable[[str], None]) -> Row:
    """Push it while it walks, at times over 0.4 s."""
    trials: list[Trial] = []
    for seed in seeds:
        note(f'policy, push, seed {seed}')
        trial = drive(seed, (0.5, 0.0, 0.0), SETTLE + 4.0, IMPULSE)
        trials.append({**trial, 'passed': trial['up']})
    passed = sum(trial['passed'] for trial in trials)
    return Row(
        what=f'policy {chosen[0]}: lateral push of {IMPULSE:g} N s in {PUSH_LASTS:g} s at 0.5 m/s',
        measured=format_count(passed, len(trials)),
        must=f'up: {len(trials)} of {len(trials)}',
        passed=passed == len(trials),
        trials=trials,
    )


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Walk, turn, be pushed, and say what that costs."""
    seeds = range(FIRST_SEED, FIRST_SEED + (3 if quick else 20))
    rows = [walk(name, velocity, seeds, note) for name, velocity in WALKS]
    return [*rows, push(seeds, note), *measure_speed(quick, note)]
