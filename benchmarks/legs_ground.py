# SPDX-License-Identifier: Apache-2.0
"""Where the Go2 has to stay up: pushes, ice, ground it does not see, and knows where it is."""

from collections.abc import Sequence
from dataclasses import replace

from experiment import Experiment, judged, Trial, worst
from go2_trouble import push_runs, random_runs
from go2_walks import constant
from legs_speed import RACE
from mujoco_sim.scene import EDGE, ICE_AHEAD, ICE_LENGTH
import numpy as np
from trials import Run, START, Trace


def pushed(
    impulse: float, speed: float, seeds: Sequence[int], share: float, gait: str = 'trot'
) -> Experiment:
    """Push the trunk to the left in each part of the gait; a share of the runs must stay up."""
    runs = push_runs(impulse, speed, seeds)
    named = '' if gait == 'trot' else f'{gait}: '
    if named:
        runs = [replace(run, parameters=(('gait.name', gait),)) for run in runs]

    def trial(trace: Trace) -> Trial:
        return {'passed': trace.is_up, 'tilt': trace.tilt}

    what = f'{named}lateral push {impulse:g} N s at {speed:g} m/s, 8 phases x {len(seeds)} seeds'
    say = lambda trials: f'{worst(trials, "tilt"):.0f} deg at worst'  # noqa: E731
    return judged(what, 'stays up', runs, trial, say, share=share)


def slippery(friction: float, seeds: Sequence[int]) -> Experiment:
    """Walk on ice from the start, told 0.5 m/s: it may slow down, not fall nor stand."""
    runs = [
        Run(seed=seed, twist=f'{START} 0.5 0 0\n', duration=START + 12.0, friction=friction)
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        x = float(trace.position[-1, 0])
        return {'passed': trace.is_up and x >= 1.0, 'x': x}

    def say(trials: list[Trial]) -> str:
        return f'{min(found["x"] for found in trials):.1f} m at least'

    return judged(f'ice: friction {friction:g} from the start', '1 m', runs, trial, say)


def patch(friction: float, speed: float, seeds: Sequence[int], share: float) -> Experiment:
    """Run onto a patch of ice and off it again."""
    end = ICE_AHEAD + EDGE + ICE_LENGTH + 0.5
    world, twist = f'ice:{friction:g}', f'{START} {speed} 0 0\n'
    duration = START + 2.0 * end / speed
    runs = [Run(seed=seed, twist=twist, duration=duration, world=world) for seed in seeds]

    def trial(trace: Trace) -> Trial:
        x = float(trace.position[-1, 0])
        passed = trace.report['falls'] == 0 and x >= end
        return {'passed': passed, 'x': x}

    what = f'ice: a patch of {friction:g} entered at {speed:g} m/s'
    return judged(what, f'{end:g} m', runs, trial, share=share)


def differing(seeds: Sequence[int], seconds: float, level: float = 1.0) -> Experiment:
    """Follow random commands with a robot that differs from its description."""
    runs = [replace(run, randomise=level) for run in random_runs(seeds, seconds)]

    def trial(trace: Trace) -> Trial:
        return {'passed': trace.is_up, 'tilt': trace.tilt, 'path': trace.path}

    what = f'randomised at {level:g}: random commands, {seconds:g} s each'
    say = lambda trials: f'{sum(r["path"] for r in trials):.0f} m'  # noqa: E731
    # One in a hundred may fall.
    return judged(what, 'no fall', runs, trial, say, share=1.0 - 1.0 / max(len(runs), 100))


def known(what: str, runs: Sequence[Run], share: float, height: float | None) -> Experiment:
    """
    Judge odometry: x and y by a share of the path, height by the path's share or a length [m].

    Of x and y what is left with the heading's drift taken out counts; both are told.
    """

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        rows = trace.after(START)
        seen, true = trace.felt.height[rows], trace.position[rows, 2]
        rise = abs(float((seen[-1] - seen[0]) - (true[-1] - true[0])))
        flat, path = apart(trace), max(trace.path, 1e-6)
        allowed = share * path if height is None else height
        passed = trace.report['falls'] == 0 and flat <= share * path and rise <= allowed
        xy = 100 * trace.odometry_error / path
        return {'passed': passed, 'xy': xy, 'apart': 100 * flat / path, 'rise': rise, 'path': path}

    def say(trials: list[Trial]) -> str:
        xy = f'{worst(trials, "apart"):.2f} % ({worst(trials, "xy"):.2f} % with heading)'
        way = sum(found['path'] for found in trials)
        return f'xy {xy}, height {100 * worst(trials, "rise"):.1f} cm at worst, {way:.0f} m'

    limit = f'{100 * share:g} %' if height is None else f'{100 * height:g} cm'
    return judged(
        f'odometry: {what}',
        f'xy, heading apart, <= {100 * share:g} %, height <= {limit}',
        runs,
        trial,
        say,
    )


def apart(trace: Trace) -> float:
    """Return where odometry would end beside the truth if its heading were right [m]."""
    rows = trace.after(START)
    true, seen = trace.position[rows, :2], trace.odometry[rows]
    steps = np.diff(seen[:, :2], axis=0)
    turn = (trace.rpy[rows, 2] - seen[:, 2])[:-1]
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.column_stack(
        (cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1])
    )
    return float(np.linalg.norm(turned.sum(axis=0) - (true[-1] - true[0])))


def climbing(world: str, seeds: Sequence[int], friction: float | None = None) -> list[Run]:
    """Return walks at 0.5 m/s up a world."""
    base = Run(seed=0, twist=f'{START} 0.5 0 0\n', duration=START + 12.0, world=world)
    return [replace(base, seed=seed, friction=friction) for seed in seeds]


def running(speed: float, seeds: Sequence[int]) -> list[Run]:
    """Return runs straight ahead on the flat: ways to and fro take back what feet slide in one."""
    return [replace(run, parameters=RACE) for run in constant((speed, 0.0, 0.0), seeds, 20.0)]
