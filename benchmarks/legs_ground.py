# SPDX-License-Identifier: Apache-2.0
"""Where the Go2 has to stay up: pushes, ice, ground it does not see, and knows where it is."""

from collections.abc import Sequence
from dataclasses import replace
import itertools
import math

from experiment import Experiment, judged, Trial, worst
from go2_trouble import push_runs, random_runs, random_script
from go2_walks import constant
from legs_speed import RACE
from mujoco_sim.scene import EDGE, ICE_AHEAD, ICE_LENGTH
import numpy as np
from trials import KEYS, Run, START, Trace

# A robot is thrown once in so long, and jumps twice [s].
THROW_EVERY = 120.0
# How long a jump takes it from a walk, and a throw until it walks again, with a second try [s].
JUMPING, RISING = 6.0, 20.0
# What a throw acts on [kg], and for how long [s].
THROWN_MASS, THROWN_FOR = 15.0, 0.1


def pushed(
    impulse: float, speed: float, seeds: Sequence[int], share: float, gait: str = 'trot'
) -> Experiment:
    """Push the trunk to the left in each part of the gait; a share of the runs must stay up."""
    runs = push_runs(impulse, speed, seeds, gait)
    named = '' if gait == 'trot' else f'{gait}: '

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


def height(
    what: str, runs: Sequence[Run], allowed: float = 0.0, share: float = 0.0, thrown: int = 0
) -> Experiment:
    """
    Judge how far off the height is at the end: by a length [m] and a share of the way.

    Every jump must have been a jump. Of `thrown` throws at least one must end in a fall: some the
    robot survives on its feet, after others it stumbles first and counts as fallen twice. It may
    fall only in the RISING seconds after a throw, goes passive at most once a throw, and drives at
    the end.
    """

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        rows = trace.after(START)
        off = np.abs(np.diff((trace.felt.height[rows], trace.position[rows, 2]), axis=0)[0])
        end, jumps = float(off[-1]), trace.run.keys.count('v')
        jumped = sum(a != b == 'jump' for a, b in itertools.pairwise(trace.state))
        fell = trace.t[1:][np.diff(trace.felt.falls) > 0]
        thrown_at = [float(push.split()[0]) for push in trace.run.push.split(';') if push]
        after = [(fell >= time) & (fell < time + RISING) for time in thrown_at]
        downs = sum(bool(hits.any()) for hits in after)
        let_go = sum(a != b == 'passive' for a, b in itertools.pairwise(trace.state))
        fell_else = trace.report['falls'] - sum(int(hits.sum()) for hits in after)
        did = jumped == jumps and downs >= min(thrown, 1) and let_go <= thrown and not fell_else
        passed = did and trace.state[-1] == 'move base' and end <= allowed + share * trace.path
        values = {'off': end, 'most': float(off.max()), 'path': trace.path, 'jumps': jumped}
        return {'passed': passed, 'downs': downs, **values}

    def say(trials: list[Trial]) -> str:
        off, most = (100 * worst(trials, name) for name in ('off', 'most'))
        way, downs = (sum(found[name] for found in trials) for name in ('path', 'downs'))
        said = f'{downs} throws that it fell by, ' if thrown else ''
        return f'{said}{off:.1f} cm at worst, {most:.1f} cm on the way, {way:.0f} m'

    limit = f'{100 * share:g} % of the way' if share else f'{100 * allowed:g} cm'
    return judged(f'height: {what}', f'<= {limit}', runs, trial, say)


def jumping_and_thrown(seeds: Sequence[int], seconds: float) -> list[Run]:
    """Return random walks on the flat with jumps, and throws that it must get up from."""
    return [_jumping_and_thrown(seed, seconds) for seed in seeds]


def _jumping_and_thrown(seed: int, seconds: float) -> Run:
    """Return one: jumps and throws in a random order, at random times."""
    random = np.random.default_rng((seed, 3))
    throws = int(seconds / THROW_EVERY)
    kinds = 2 * throws * ['v'] + throws * ['']
    random.shuffle(kinds)
    slot = seconds / (len(kinds) + 1)
    keys, pushes = KEYS, []
    for index, kind in enumerate(kinds):
        time = START + index * slot + float(random.uniform(3.0, slot - RISING))
        if kind:
            keys += f'{time:.3f} 2\n{time + 2.0:.3f} v\n{time + JUMPING:.3f} 5\n'
            continue
        angle, speed, up = random.uniform((-math.pi, 4.0, 1.0), (math.pi, 7.0, 3.0))
        force = (
            THROWN_MASS
            / THROWN_FOR
            * np.array((speed * math.cos(angle), speed * math.sin(angle), up))
        )
        pushes.append(' '.join(f'{number:.3f}' for number in (time, *force, THROWN_FOR)))
        keys += f'{time + 4.0:.3f} 2\n{time + 0.6 * RISING:.3f} 2\n{time + RISING - 1.0:.3f} 5\n'
    return Run(
        seed=seed,
        twist=random_script(seed, seconds),
        keys=keys,
        push=';'.join(pushes),
        duration=START + seconds,
    )


def to_and_fro(world: str, seeds: Sequence[int], ways: Sequence[float]) -> list[Run]:
    """Return walks at 0.5 m/s so far ahead [m] and, of a negative way, backwards, in turn."""
    time, lines = START, []
    for way in ways:
        lines.append(f'{time:g} {math.copysign(0.5, way)} 0 0')
        time += abs(way) / 0.5
    twist = '\n'.join(lines) + '\n'
    return [Run(seed=seed, twist=twist, duration=time, world=world) for seed in seeds]
