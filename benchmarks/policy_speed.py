# SPDX-License-Identifier: Apache-2.0
"""What a policy costs: its step, time simulated under it, steps of the environment; wall time."""

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
import statistics
import tempfile
import time

from idle_core import IdleCore
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
STEPS_OF_SLICE = 100  # of the environment
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


def speed_row(core: IdleCore, seconds: int) -> Row:
    """Walk at 0.5 m/s without ROS and without a picture; so does the model-based walker."""
    slices = round(seconds / SLICE)
    own, walker = (core.rates(_walking(key), slices) for key in ('p', '5'))
    ratio, passed = own.overall / walker.overall, own.reaches(LEAST)
    return Row(
        what='policy ours: real-time factor of a wasd.Go2 at 0.5 m/s on an idle core',
        measured=f'{own.told(1)}, {ratio:.1f} x the {walker.overall:.1f} of the model-based',
        must=f'>= {LEAST:g}',
        passed=passed,
        trials=[{'passed': passed, **own._asdict(), 'model_based': walker.overall}],
    )


def _walking(key: str) -> Callable[[], float]:
    """Have a Go2 walk at 0.5 m/s in the state of a key; return what measures its factor."""
    dog = wasd.Go2(policy='ours')
    for press, wait in (('2', 2.5), (key, 1.5)):
        dog.press(press)
        dog.run(wait)
    dog.drive(0.5, 0.0, 0.0)
    dog.run(1.0)

    def measure() -> float:
        begun = time.perf_counter()
        dog.run(SLICE)
        return SLICE / (time.perf_counter() - begun)

    return measure


def environment_row(core: IdleCore, slices: int) -> Row:
    """Step one environment on one core: standing, and with random actions (with its resets)."""
    import gymnasium
    from wasd.environment import PHYSICS_STEPS

    env = gymnasium.make('wasd/Go2-v0')
    chance = np.random.default_rng(1)

    def measure(most: float) -> float:
        """Step with random actions up to `most`; return steps a second."""
        actions = chance.uniform(-most, most, (STEPS_OF_SLICE, *(env.action_space.shape or ())))
        actions = actions.astype(np.float32)
        begun = time.perf_counter()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return STEPS_OF_SLICE / (time.perf_counter() - begun)

    rates = {}
    for name, most in (('standing', 0.0), ('random', 1.0)):
        env.reset(seed=1)
        rates[name] = core.rates(partial(measure, most), slices)
    env.close()
    standing, random = rates['standing'], rates['random']
    passed = standing.reaches(LEAST_STEPS)
    return Row(
        what=f'wasd/Go2-v0, physics of {1e3 * PHYSICS_STEPS[-1]:g} ms: steps a second on one '
        'idle core, standing, random actions',
        measured=f'{standing.told(0)}; {random.told(0)}',
        must=f'standing >= {LEAST_STEPS:g}',
        passed=passed,
        trials=[{'passed': passed, **standing._asdict(), 'random': random.overall}],
    )


def measure_speed(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Time all three; the environment needs the extra gym."""
    note('policy: wall time')
    core = IdleCore()
    rows = [step_row(STEPS // 5 if quick else STEPS), speed_row(core, 5 if quick else 30)]
    if find_spec('gymnasium') is not None:
        rows.append(environment_row(core, 10 if quick else 100))
    return rows
