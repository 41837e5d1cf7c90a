# SPDX-License-Identifier: Apache-2.0
"""`wasd describe policy FILE`: settings of a policy, its oddities, and a trial walk."""

import argparse
from collections.abc import Callable, Iterator
import math
from typing import Any, NamedTuple

from mujoco_sim.robot_setup import COMMAND_DELAY
from mujoco_sim.world import World
import numpy as np
from policy_player.player import Player
from policy_player.policy_file import duration_of, Policy, read_policy
from policy_player.spec import PolicySpec
from policy_player.usual import beyond_limits, oddities, order_of, variants
from quadruped_sim.states.policy import SETTLE_TIME
from wasd.robots import Go2
from wasd_core.robot_io import JointTargets, Senses

from wasd_bringup.run.options import TRUE_SCAN

# A trial: up, still for so long, then ahead, then turning [s], [m/s], [rad/s].
RISE, STILL, AHEAD, TURN = 2.2, 1.0, 2.5, 2.0
SPEED, RATE = 0.5, 0.5
# Only the last part of each counts, this long [s].
COUNTED = 1.0
# Another reading is the one that was meant if its cost is lower by this; 1 is all wrong.
BETTER = 0.25
# What is walked well.
WELL = 0.3
# An observation beyond this is out of range, where no clip says it: networks are trained on
# numbers of about 1.
LARGEST = 10.0


class Trial(NamedTuple):
    """
    The result of a policy's walk: time of a fall [s], velocities, roughness of its targets.

    `shown` (2, width) are the least and the largest of each number shown. `failure` is why it
    could not be played to the end, '' where it could.
    """

    fell_at: float | None
    drift: float
    speed: float
    rate: float
    jerk: float
    shown: np.ndarray
    failure: str = ''

    @property
    def cost(self) -> float:
        """The error of its velocities, from 0; 3 or more if it fell."""
        if self.fell_at is not None:
            return 4.0 - min(self.fell_at, 10.0) / 10.0
        off = [self.drift / SPEED, abs(self.speed - SPEED) / SPEED, abs(self.rate - RATE) / RATE]
        return float(np.mean(np.minimum(off, 1.0))) + 0.2 * min(self.jerk, 1.0)


class Stand:
    """One robot on which one policy after the other is tried."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        """Take the joints that all of them have, in any order."""
        self._walker = _Exchangeable(joints)
        self.dog = Go2(policy=self._walker, height_scan=TRUE_SCAN)

    def try_policy(self, policy: Policy) -> Trial:
        """Stand, then play a policy: still, ahead, turning."""
        dog, walker = self.dog, self._walker
        walker.play(policy)
        dog.reset()
        dog.press('2')
        dog.run(RISE)
        dog.press('p')
        dog.run(SETTLE_TIME)
        begun, found = dog.time, []
        for command, span in (((0.0, 0.0), STILL), ((SPEED, 0.0), AHEAD), ((0.0, RATE), TURN)):
            if dog.state != 'policy':
                break
            dog.drive(command[0], 0.0, command[1])
            speeds = []
            for _ in range(round(span / 0.05)):
                dog.run(0.05)
                speeds.append(dog.truth.planar_velocity)
                if dog.state != 'policy':
                    break
            found.append(np.mean(speeds[-round(COUNTED / 0.05) :], axis=0))
        has_fallen = dog.state != 'policy'
        found += [np.zeros(3)] * (3 - len(found))
        shown = np.array(walker.shown or [np.zeros(policy.spec.width)])
        targets = np.array(walker.targets)
        return Trial(
            dog.time - begun if has_fallen else None,
            float(np.linalg.norm(found[0][:2])),
            float(found[1][0]),
            float(found[2][2]),
            float(np.abs(np.diff(targets, axis=0)).mean()) if len(targets) > 1 else 0.0,
            np.array([shown.min(axis=0), shown.max(axis=0)]),
            walker.failure,
        )


class _Exchangeable:
    """A walker that plays another policy when it is told to; joints keep their order."""

    ranges: tuple[tuple[float, float], ...] | None = None
    has_height_scan = True  # one of them may

    def __init__(self, joints: tuple[str, ...]) -> None:
        self.joints, self.default = joints, np.zeros(len(joints))
        self.shown: list[np.ndarray] = []
        self.targets: list[np.ndarray] = []
        self._player: Player | None = None
        self.heights: Callable[[], np.ndarray | None] = lambda: None

    def play(self, policy: Policy) -> None:
        """Play another policy from now on."""
        self._player = player = Player(policy)
        player.heights = self.heights
        self._theirs = np.array([self.joints.index(name) for name in player.joints])
        self._ours = np.argsort(self._theirs)
        self.shown, self.targets = [], []

    @property
    def failure(self) -> str:
        """Why it cannot go on."""
        return self._player.failure if self._player else ''

    def reset(self) -> None:
        """Forget the past."""
        if self._player is not None:
            self.default[:] = self._player.default[self._ours]
            self._player.reset()

    def step(self, senses: Senses, command: np.ndarray, dt: float) -> JointTargets:
        """Return what the policy says, in our order."""
        assert self._player is not None  # `play` comes first
        joints = [part[self._theirs] for part in senses[3:]]
        targets = self._player.step(Senses(*senses[:3], *joints), command, dt)
        self.shown.append(self._player.observation)
        self.targets.append(targets.position)
        return JointTargets(*(part[self._ours] for part in targets))


def suspicions(stand: Stand, policy: Policy, trial: Trial) -> Iterator[str]:
    """Yield each mistake without which the policy walks clearly better, the best first."""
    if trial.cost < WELL or trial.failure:
        return
    found = []
    for words, spec in variants(policy.spec):
        if spec != policy.spec:
            other = stand.try_policy(policy._replace(spec=spec))
            if other.cost < trial.cost - BETTER:
                found.append((other.cost, words, other))
    for _, words, other in sorted(found, key=lambda one: one[0]):
        yield f'{words}? Then {_told(other)}'


def _told(trial: Trial) -> str:
    if trial.failure:
        return trial.failure
    if trial.fell_at is not None:
        return f'it falls after {trial.fell_at:.1f} s'
    return (
        f'at zero command it drifts at {trial.drift:.2f} m/s, at {SPEED:g} m/s it walks '
        f'{trial.speed:.2f}, at {RATE:g} rad/s it turns {trial.rate:.2f}'
    )


def out_of_range(spec: PolicySpec, shown: np.ndarray) -> str:
    """Return the first observation that leaves its range, in words; '' where none does."""
    at = 0
    for term, name, age in _columns(spec):
        width = spec.width_of(term)
        low, high = shown[0, at : at + width], shown[1, at : at + width]
        scale = max(max(map(abs, term.scale)), 1e-9)
        least, most = np.array(term.clip) * (1.0 if term.scales_first else scale)
        least, most = max(float(least), -LARGEST), min(float(most), LARGEST)
        for index in range(width):
            if low[index] < least or high[index] > most:
                return (
                    f'{name}[{index}]{age}: {low[index]:.3g} to {high[index]:.3g}, '
                    f'wanted {least:.3g} to {most:.3g}'
                )
        at += width
    return ''


def _columns(spec: PolicySpec) -> Iterator[tuple[Any, str, str]]:
    """Yield the terms in the order in which they are shown."""
    ages = spec.terms[0].ages if spec.by_time else (0,)
    for outer in ages:
        for term in spec.terms:
            for age in (outer,) if spec.by_time else term.ages:
                yield term, term.name, f' {age} steps ago' if age else ''


def lines_of(policy: Policy) -> Iterator[str]:
    """Yield what a policy says, a line each."""
    spec, network = policy.spec, policy.network
    took = 1e3 * duration_of(network)
    yield f'network      {network.takes} numbers to {network.gives}, {took:.2f} ms a step here'
    yield f'trained with {policy.config or spec.source}'
    yield f'step         {1e3 * spec.period:g} ms'
    yield f'joints       {order_of(spec)}'
    for name, values, unit in (
        ('stiffness', spec.stiffness, 'N m/rad'),
        ('damping', spec.damping, 'N m s/rad'),
        ('action scale', spec.action_scale, 'rad'),
        ('default', spec.default_position, 'rad'),
    ):
        yield f'{name:12} {_shown(values)} {unit}'
    for term in spec.terms:
        clip = '' if math.isinf(term.clip[1]) else f', within {term.clip[0]:g} to {term.clip[1]:g}'
        history = f', steps ago {" ".join(map(str, term.ages))}' if len(term.ages) > 1 else ''
        yield f'observation  {term.name} x {_shown(term.scale)}{clip}{history}'
    if any(len(term.ages) > 1 for term in spec.terms):
        yield f'history      {"by time" if spec.by_time else "by term"}'
    if spec.ranges is not None:
        names = zip(('ahead', 'left', 'turn'), spec.ranges, strict=True)
        yield 'commands     ' + ', '.join(
            f'{name} {low:g} to {high:g}' for name, (low, high) in names
        )
    for words in spec.assumed:
        yield f'assumed      {words}'


def _shown(values: Any) -> str:
    plain = [f'{value:g}' for value in values]
    return plain[0] if len(set(plain)) == 1 else ' '.join(plain)


def simulator_lines(world: World) -> Iterator[str]:
    """Yield what the physics has that training may not have had."""
    model, joints = world.model, world.parts.velocity
    armature, damping, loss = (
        np.unique(np.round(array[joints], 6)).tolist()
        for array in (model.dof_armature, model.dof_damping, model.dof_frictionloss)
    )
    robot = model.body_rootid[model.geom_bodyid] == world.root
    friction = float(model.geom_friction[robot & (model.geom_contype > 0), 0].max())
    yield (
        f'simulator    armature {_shown(armature)} kg m^2, damping {_shown(damping)} N m s/rad, '
        f'dry friction {_shown(loss)} N m'
    )
    yield (
        f'simulator    friction of feet {friction:g} (--friction MU), delay of commands '
        f'{1e3 * COMMAND_DELAY:g} ms'
    )
    yield 'simulator    noise and drift of sensors (--imu-drift); all at random by --randomise'


def describe_policy_command(arguments: argparse.Namespace) -> int:
    """Print what a policy is; return 1 where something is odd about it, or it walks badly."""
    policy = read_policy(arguments.path, arguments.policy_config)
    for line in lines_of(policy):
        print(line)
    odd = oddities(policy.spec)
    for words in odd:
        print(f'odd          {words}')
    if arguments.no_trial:
        return int(bool(odd))
    stand = Stand(policy.spec.joints)
    if beyond := beyond_limits(policy.spec, stand.dog._robot.description.robot):
        odd.append(beyond)
        print(f'odd          {beyond}')
    for line in simulator_lines(stand.dog._robot.world):
        print(line)
    trial = stand.try_policy(policy)
    print(f'trial        {_told(trial)}')
    far = out_of_range(policy.spec, trial.shown)
    print(f'observations {far or "all in range"}')
    doubts = list(suspicions(stand, policy, trial))
    for words in doubts:
        print(f'suspect      {words}')
    if not doubts and trial.cost >= WELL and not trial.failure:
        print('suspect      no other reading of its numbers walks better')
    return int(bool(odd) or trial.cost >= WELL)
