# SPDX-License-Identifier: Apache-2.0
"""What a policy costs: its step, time simulated under it, steps of the environment; wall time."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
import statistics
import tempfile
import time

import numpy as np
from policy_player.onnx_writer import write_layers
from policy_player.player import Player
from policy_player.policy_file import read_policy
from table import Row
import wasd
from wasd_core.robot_io import Senses

# Neurons of the network whose step is timed.
NEURONS = (512, 256, 128)
MOST = 0.15  # of a step of it, inference and all around it, median [ms]
STEPS = 3000
LEAST = 25.0  # real-time factor of a Go2 that walks by a policy, nothing shown
SLICE = 0.25  # of simulated time [s]
IDLE = 1.05  # a loop of at most so many times the shortest: nobody shares the core
LEAST_STEPS = 2500.0  # of the environment, each second
LEVEL = np.array((1.0, 0.0, 0.0, 0.0))


def step_row(steps: int) -> Row:
    """Time a network of a usual size whose senses change at each step."""
    from wasd.environment import SPEC

    chance = np.random.default_rng(1)
    widths = (SPEC.width, *NEURONS, len(SPEC.joints))
    layers = [
        (chance.normal(0.0, 0.05, (after, before)), np.zeros(after))
        for before, after in zip(widths, widths[1:], strict=False)
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'walk.onnx'
        write_layers(path, SPEC, layers)
        player = Player(read_policy(path))
    count, period = len(SPEC.joints), player.spec.period
    default, told, spent = player.default, np.array((0.5, 0.0, 0.0)), []
    for _ in range(steps):
        rates, positions = chance.normal(0.0, 0.1, 3), default + chance.normal(0.0, 0.1, count)
        senses = Senses(LEVEL, rates, np.zeros(3), positions, chance.normal(0.0, 1.0, count))
        begun = time.perf_counter()
        player.step(senses, told, period)
        spent.append(1e3 * (time.perf_counter() - begun))
    middle, late = statistics.median(spent), float(np.percentile(spent, 99))
    size = '-'.join(map(str, NEURONS))
    return Row(
        what=f'policy of {size}: a step, inference and glue',
        measured=f'median {middle:.3f}, p99 {late:.3f} ms',
        must=f'median <= {MOST:g} ms',
        passed=middle <= MOST,
        trials=[{'passed': middle <= MOST, 'median': middle, 'p99': late}],
    )


def speed_row(seconds: int) -> Row:
    """
    Walk at 0.5 m/s without ROS and without a picture, in slices of a quarter of a second.

    The model-based walker does the same by turns. A core that shares its hardware with somebody
    is not idle: a fixed loop before and after each slice tells, which then takes longer.
    """
    dogs = {'policy': _walking('p'), 'model': _walking('5')}
    factors: dict[str, list[float]] = {name: [] for name in dogs}
    loops = []
    for _ in range(round(seconds / SLICE)):
        before = _loop()
        for name, dog in dogs.items():
            begun = time.perf_counter()
            dog.run(SLICE)
            factors[name].append(SLICE / (time.perf_counter() - begun))
            if name == 'policy':
                loops.append(max(before, _loop()))
    own, fastest = factors['policy'], min(loops)
    idle = [now for now, loop in zip(own, loops, strict=True) if loop <= IDLE * fastest]
    middle, walker = statistics.median(own), statistics.median(factors['model'])
    alone = statistics.median(idle)
    return Row(
        what='policy ours: real-time factor of a wasd.Go2 at 0.5 m/s on an idle core; '
        'model-based by turns',
        measured=f'{alone:.1f} in {len(idle)} of {len(own)} slices, in which it was idle; '
        f'{middle:.1f} in all, {middle / walker:.1f} x the {walker:.1f} of the model-based',
        must=f'>= {LEAST:g}',
        passed=alone >= LEAST,
        trials=[
            {'passed': now >= LEAST, 'factor': now, 'loop': loop}
            for now, loop in zip(own, loops, strict=True)
        ],
    )


def _loop() -> float:
    """Return how long a fixed loop takes [s], some 7 ms."""
    begun, total = time.perf_counter(), 0
    for count in range(200_000):
        total += count
    return time.perf_counter() - begun


def _walking(key: str) -> wasd.Go2:
    """Return a Go2 that walks at 0.5 m/s, in the state of a key."""
    dog = wasd.Go2(policy='ours')
    for press, wait in (('2', 2.5), (key, 1.5)):
        dog.press(press)
        dog.run(wait)
    dog.drive(0.5, 0.0, 0.0)
    dog.run(1.0)
    return dog


def environment_row(steps: int) -> Row:
    """Step one environment on one core: standing, and with random actions (with its resets)."""
    import gymnasium
    from wasd.environment import PHYSICS_STEPS

    env = gymnasium.make('wasd/Go2-v0')
    chance = np.random.default_rng(1)
    shape = (steps, *env.action_space.shape)
    stand = np.zeros(shape, np.float32)
    actions = {'standing': stand, 'random': chance.uniform(-1.0, 1.0, shape).astype(np.float32)}
    rates = {}
    for name, chosen in actions.items():
        env.reset(seed=1)
        begun = time.perf_counter()
        for action in chosen:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        rates[name] = steps / (time.perf_counter() - begun)
    env.close()
    return Row(
        what=f'wasd/Go2-v0, physics of {1e3 * PHYSICS_STEPS[-1]:g} ms: steps a second on one '
        'core, standing, random actions',
        measured=', '.join(f'{rate:.0f}' for rate in rates.values()),
        must=f'standing >= {LEAST_STEPS:g}',
        passed=rates['standing'] >= LEAST_STEPS,
        trials=[{'passed': rates['standing'] >= LEAST_STEPS, **rates}],
    )


def measure_speed(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Time all three; the environment needs the extra gym."""
    note('policy: wall time')
    rows = [step_row(STEPS // 5 if quick else STEPS), speed_row(5 if quick else 30)]
    if find_spec('gymnasium') is not None:
        rows.append(environment_row(STEPS // 5 if quick else STEPS))
    return rows
