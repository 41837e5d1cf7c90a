# SPDX-License-Identifier: Apache-2.0
"""Every joint of a robot by PD: limp, in a pose, or as a policy says; no ROS, no clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
import math

import numpy as np
from wasd_core.errors import suggest
from wasd_core.robot_io import command_bounds, JointCommand, JointTargets, Reading, Senses
from wasd_core.timing import Watchdog

from policy_player.observations import gravity_in_base
from policy_player.player import Player
from policy_player.spec import PolicyError

# From wherever joints are to the pose of the stand [s].
SETTLE_TIME = 1.5
# Further over than this it falls, and motors only damp [rad]: trainings of humanoids end there.
FALL_TILT = 0.8
# A velocity is forgotten after so long [s], and ramps by so much [m/s^2], [m/s^2], [rad/s^2].
TIMEOUT, RAMPS = 0.5, np.array((0.8, 0.8, 1.6))
# What is followed of velocities whose range no file tells [m/s], [m/s], [rad/s].
USUAL_RANGES = ((-0.5, 1.0), (-0.3, 0.3), (-0.5, 0.5))


class State(StrEnum):
    """What the joints do."""

    PASSIVE = 'passive'
    STAND = 'stand'
    POLICY = 'policy'


# What a key leads to, and from where.
STATE_KEYS = {'1': State.PASSIVE, '2': State.STAND, 'p': State.POLICY}


@dataclass(frozen=True)
class Means:
    """How to give a network, raise a fallen robot, and put it back; defaults: node by node."""

    policy: str = '-p policy:=FILE'
    hoist: str = '/simulator/hoist'
    reset: str = '/simulator/reset'


class JointController:
    """
    Drives joints, in the order of `joints`, by a `JointCommand` a step.

    Passive is damping alone. The stand goes to a pose, in which it stays. The policy says where
    joints are to be; joints that it does not have stay in the stand's pose. A fall, readings or
    a network that say no number make it passive; `take_remark` tells why, once.
    """

    def __init__(
        self, joints: Sequence[str], stand: JointTargets, player: Player | None = None
    ) -> None:
        """
        Take the stand, in the order of `joints`; its pose is the policy's where there is one.

        Raises:
            PolicyError: the policy is another robot's, or wants to know what this one does not.
        """
        self.joints, self._player = tuple(joints), player
        self.means = Means()  # a run or a script puts its own here
        self._theirs = np.arange(0)
        self._stand = JointTargets(*(np.array(part, dtype=float) for part in stand))
        ranges = player.ranges if player is not None else None
        self._low, self._high = command_bounds(ranges or USUAL_RANGES)
        if player is not None:
            self._theirs = self._find(player)
            player.reset()
            self._stand.position[self._theirs] = player.default
        self._age = Watchdog(TIMEOUT)
        self.reset()

    def _find(self, player: Player) -> np.ndarray:
        for name in player.joints:
            if name not in self.joints:
                raise PolicyError(
                    f'policy: joint {name} is not in this robot{suggest(name, self.joints)}'
                )
        for term in player.spec.terms:
            if term.name == 'linear_velocity' or term.name.startswith('height_scan'):
                raise PolicyError(
                    f'policy: observation {term.name}: nothing here estimates it, take a network '
                    'without (on four legs the leg controller does, by its parameter policy)'
                )
        return np.array([self.joints.index(name) for name in player.joints])

    @property
    def has_policy(self) -> bool:
        """Whether a network can walk."""
        return self._player is not None

    @property
    def full(self) -> tuple[float, float, float]:
        """The fastest that is followed ahead and to the left [m/s], and in a turn [rad/s]."""
        ahead, left, turn = self._high.tolist()
        return ahead, left, turn

    @property
    def backward(self) -> float:
        """The fastest that is followed back [m/s]."""
        return float(-self._low[0])

    def reset(self) -> None:
        """Forget the past: passive, at rest."""
        self.state = State.PASSIVE
        self.is_fallen = False
        self.hindrance = ''  # why the network must not walk now; '' if it may
        self._remark = ''
        self._settled = 0.0
        self._rest()

    def _rest(self) -> None:
        self._age.reset()
        self._asked = np.zeros(3)
        self.velocity = np.zeros(3)  # that is followed now

    def refusal(self, key: str) -> str:
        """Return why a state key does nothing now, '' where it does something."""
        wanted = STATE_KEYS[key]
        if wanted is State.POLICY:
            if not self.has_policy:
                return self._no_policy
            if self.hindrance:
                return self.hindrance
            if self.state is State.PASSIVE:
                return 'press 2 to stand, then p'
            if self._settled < SETTLE_TIME and self.state is State.STAND:
                return 'press p again in a second: it still goes to its pose'
        if wanted is State.STAND and self.is_fallen:
            means = self.means
            return f'raise it by {means.hoist}, or put it back by {means.reset} (it has fallen)'
        return ''

    @property
    def _no_policy(self) -> str:
        return f'give {self.means.policy}: there is no network to walk with'

    def press(self, key: str) -> str:
        """Take a state key; return what is to be said to it."""
        wanted, refusal = STATE_KEYS[key], self.refusal(key)
        if refusal or wanted is self.state:
            return refusal or f'it is in {wanted.value} already'
        self._rest()
        self.state, self._settled = wanted, 0.0
        self._began: np.ndarray | None = None  # where joints are at the next step
        if wanted is State.POLICY and self._player is not None:
            self._player.reset()
        return ''

    def command(self, velocity: Sequence[float]) -> str:
        """Take a velocity [m/s], [m/s], [rad/s]; return why it is not followed, '' where it is."""
        if not all(map(math.isfinite, velocity)):
            return 'a velocity that is no number is ignored'
        if self.state is not State.POLICY:
            if not any(velocity):
                return ''
            first = '' if self.state is State.STAND else '2, then '
            walk = f'press {first}p to walk (it is {self.state})'
            return walk if self.has_policy else self._no_policy
        self._asked = np.clip(velocity, self._low, self._high)
        self._age.hear()
        return ''

    def let_go(self, why: str = '') -> None:
        """Be limp at once."""
        self.state = State.PASSIVE
        self._remark = why or self._remark
        self._rest()

    def take_remark(self) -> str:
        """Return what has happened and is to be said; '' for nothing."""
        said, self._remark = self._remark, ''
        return said

    def step(self, reading: Reading, dt: float) -> JointCommand:
        """Return the motors' command for a reading of `joints` `dt` [s] after the one before."""
        imu, joints = reading.imu, reading.joints
        senses = [joints.position, joints.velocity, *(imu or ())]
        if imu is None or not all(np.isfinite(part).all() for part in senses):
            if self.state is not State.PASSIVE:
                self.let_go('the readings are not numbers: motors damp')
            return self._damping()
        self._watch(math.acos(min(max(-float(gravity_in_base(imu.orientation)[2]), -1.0), 1.0)))
        if self.state is State.PASSIVE:
            return self._damping()
        if self.state is State.POLICY and self.hindrance:
            self.press('2')  # motors hold a stand by themselves
        if self.state is State.STAND or self._player is None:
            self._settled += dt
            return self._towards_stand(joints.position)
        self._follow(dt)
        own = self._theirs
        told = Senses(
            imu.orientation,
            imu.angular_velocity,
            np.zeros(3),
            joints.position[own],
            joints.velocity[own],
        )
        targets = JointTargets(*(part.copy() for part in self._stand))
        for part, said in zip(targets, self._player.step(told, self.velocity, dt), strict=True):
            part[own] = said
        if self._player.failure:
            self.let_go(f'{self._player.failure}: motors damp')
            return self._damping()
        return _command(targets)

    def _watch(self, tilt: float) -> None:
        """Let go of a robot that falls; forget that when it is upright again."""
        if tilt < 0.5 * FALL_TILT:
            self.is_fallen = False
        elif tilt > FALL_TILT and not self.is_fallen:
            self.is_fallen = True
            if self.state is not State.PASSIVE:
                self.let_go(
                    f'fallen: {self.means.hoist} raises it, {self.means.reset} puts it back '
                    f'(motors damp beyond a tilt of {math.degrees(FALL_TILT):.0f} deg)'
                )

    def _follow(self, dt: float) -> None:
        self._age.step(dt)
        asked = self._asked if self._age.is_alive else np.zeros(3)
        self.velocity = self.velocity + np.clip(asked - self.velocity, -RAMPS * dt, RAMPS * dt)

    def _towards_stand(self, position: np.ndarray) -> JointCommand:
        if self._began is None:
            self._began = position.copy()
        share = min(self._settled / SETTLE_TIME, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        pose = self._began + share * (self._stand.position - self._began)
        return _command(self._stand._replace(position=pose))

    def _damping(self) -> JointCommand:
        none = np.zeros_like(self._stand.position)
        return _command(JointTargets(none, none, self._stand.damping))


def _command(targets: JointTargets) -> JointCommand:
    none = np.zeros_like(targets.position)
    return JointCommand(targets.position, none, none, targets.stiffness, targets.damping)
