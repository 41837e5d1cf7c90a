# SPDX-License-Identifier: Apache-2.0
"""What the Go2 does on a key: it gets up from any pose, jumps, and falls by none."""

from collections.abc import Sequence
import random

from experiment import Experiment, judged, Trial, worst
import numpy as np
from quadruped_sim.states.jump import EXTENDED
from quadruped_sim.tuning import JumpParameters
from random_keys import monkey_keys
from robot_description.morphology.quadruped import GO2, Scale
from trials import KEYS, Run, START, Trace

SETTLED = 2.0  # a robot let fall lies still after so long [s]
PATIENCE = 6.0
STANDING = 0.27  # height of the trunk above the feet of one that stands [m]
# Height of the base as its legs stop pushing in a jump [m].
TAKE_OFF = EXTENDED + 0.022
TURNED = np.deg2rad(15.0)


def get_up(
    what: str,
    world: str,
    x: float,
    seeds: Sequence[int],
    *,
    description: str = '',
    scale: Scale = GO2,
    patience: float = PATIENCE,
    share: float = 1.0,
) -> Experiment:
    """
    Let the robot fall anyhow at x [m], and press key 2: it stands within `patience` [s], a Go2's.

    `description` is the file of another robot, of this `scale`.
    """
    second, standing = scale.of('s'), STANDING * scale.of('m')
    settled, patience = SETTLED * second, patience * second
    runs = [
        Run(
            seed=seed,
            keys=f'{settled} 2\n',
            duration=settled + patience + second,
            description=description,
            world=world,
            tumbled=x,
        )
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        rows = trace.after(settled)
        is_level = np.abs(trace.rpy[rows, :2]).max(axis=1) < TURNED
        is_up = (trace.felt.clearance[rows] > standing) & is_level
        stays = np.logical_and.accumulate(is_up[::-1])[::-1]
        took = float(trace.t[rows][stays.argmax()]) - settled if stays.any() else np.inf
        return {'passed': took <= patience, 'took': min(took, 99.0), 'ends': trace.state[-1]}

    def say(trials: list[Trial]) -> str:
        return f'{worst([t for t in trials if t["passed"]] or trials, "took"):.1f} s at worst'

    return judged(f'get up: {what}', f'<= {patience:.3g} s', runs, trial, say, share=share)


def jump(
    what: str, key: str, far: float | None, seeds: Sequence[int], **parameters: float
) -> Experiment:
    """
    Jump once from a stand: all feet clear, and so `far` ahead [m]; then stand.

    Without `far` it is to come as high and far as it is asked, within 2 and 3 cm.
    """
    asked = JumpParameters(**parameters)
    chosen = tuple((f'jump.{name}', value) for name, value in parameters.items())
    pressed = 3.0
    runs = [
        Run(seed=seed, keys=f'0.1 2\n{pressed} {key}\n', duration=7.0, parameters=chosen)
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        assert trace.felt is not None
        rows = trace.after(pressed)
        clear = float(trace.felt.lowest[rows].max())
        ahead = float(trace.position[-1, 0] - trace.position[rows][0, 0])
        rise = float(trace.position[rows, 2].max()) - TAKE_OFF
        stands = trace.report['falls'] == 0 and trace.state[-1] == 'fixed stand'
        passed = stands and (ahead >= far if far else clear >= 0.25)
        if far is None:
            passed = stands and abs(ahead - asked.distance) <= 0.03
            passed = passed and abs(rise - asked.height) <= 0.02
        values = {'clear': clear, 'ahead': ahead, 'rise': rise, 'ends': trace.state[-1]}
        return {'passed': passed, **values}

    def say(trials: list[Trial]) -> str:
        if far is None:
            rises, ways = ([found[name] for found in trials] for name in ('rise', 'ahead'))
            return (
                f'{100 * min(rises):.1f}-{100 * max(rises):.1f} cm high, '
                f'{min(ways):.3f} to {max(ways):.3f} m ahead'
            )
        clear, ahead = (min(found[name] for found in trials) for name in ('clear', 'ahead'))
        return f'feet {100 * clear:.0f} cm clear, {ahead:.2f} m ahead at least'

    must = f'{far:g} m ahead' if far else '25 cm clear'
    if far is None:
        must = 'as asked within 2 and 3 cm'
    return judged(f'jump: {what}', f'{must}, stands', runs, trial, say)


def monkey(
    what: str, seeds: Sequence[int], time: float, *, world: str = 'flat', gait: str = 'trot'
) -> Experiment:
    """Press random keys for a time [s], sticks, states, gaits and jumps: nothing falls."""
    chosen = (('gait.name', gait),)
    runs = [
        Run(seed=seed, keys=monkey_keys(time, seed), duration=time, world=world, parameters=chosen)
        for seed in seeds
    ]

    def trial(trace: Trace) -> Trial:
        return {'passed': trace.report['falls'] == 0, 'ends': trace.state[-1]}

    return judged(f'random keys, {time:g} s: {what}', '0 falls', runs, trial)


def swing(speed: float, turn: float, seeds: Sequence[int], *, time: float = 20.0) -> Experiment:
    """
    Walk at a speed [m/s] and turn [rad/s], halt anywhere in a step, and swing a foot for a time.

    The stick goes from one of its ends to another every 1.5 s.
    """

    def run(seed: int) -> Run:
        chance = random.Random(f'{speed} {turn} {seed}')
        halt = START + chance.uniform(2.0, 4.0)
        begin = halt + chance.choice((0.05, chance.uniform(0.1, 1.0), chance.uniform(1.0, 6.0)))
        lines, now = [KEYS.strip(), f'{halt:.3f} 2', f'{begin:.3f} 9'], begin + 4.0
        while now < begin + 4.0 + time:
            lines.append(f'{now:.3f} {chance.choice("wsadik")}*40')
            now += 1.5
        return Run(
            seed=seed,
            keys='\n'.join(lines) + '\n',
            twist=f'{START} {speed} 0 {turn}\n',
            duration=now,
        )

    def trial(trace: Trace) -> Trial:
        stays = trace.report['falls'] == 0 and trace.state[-1] == 'swing test'
        return {'passed': stays, 'ends': trace.state[-1]}

    after = f'after {speed:g} m/s' + (f', {turn:g} rad/s' if turn else '')
    must = f'stands {time:g} s, stick at its ends'
    return judged(f'swing test {after}', must, [run(seed) for seed in seeds], trial)
