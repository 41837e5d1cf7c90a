# SPDX-License-Identifier: Apache-2.0
"""A walker from outside, as a neural network, in place of the gait: key p."""

import math
from types import GenericAlias
from typing import Any, Protocol, runtime_checkable

import numpy as np
from wasd_core.arguments import check
from wasd_core.errors import suggest, UserError
from wasd_core.jit import jit
from wasd_core.parameters import shown
from wasd_core.robot_io import command_bounds, JointCommand, JointTargets, Senses
from wasd_core.timing import ROUNDING

from quadruped_sim.estimation.ground import follow_plane
from quadruped_sim.robot_model import NO_TORQUE
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.driving import (
    AfterTrot,
    ControllerParts,
    smooth,
    stiff_command,
    Trotting,
)

# From the stand to the pose in which a walker begins [s].
SETTLE_TIME = 1.0
# A command is not followed if for so long [s] less than this share of it comes out, of one that
# is above the least [m/s], [m/s], [rad/s].
NOT_FOLLOWED_TIME, SHARE = 2.0, 0.4
LEAST = (0.1, 0.1, 0.15)
AXES = (('ahead', 'm/s'), ('left', 'm/s'), ('turn', 'rad/s'))
# Averages of what comes out, over the steps of a gait [s].
AVERAGE_TIME = 0.5
# A walker says its targets far less often than a gait: between its steps one looks so often [s].
# In 10 s of a walk odometry strays by 19 mm, by 12 mm with a look in each instant.
LOOK_PERIOD = 0.01
# A foot that touches is trusted wholly after so long [s].
TRUST_TIME = 0.03
# The least and the most vx, vy [m/s] and wz [rad/s] of a command.
RANGES: Any = tuple[(tuple[float, float],) * 3]  # type: ignore[misc]
# Velocity and effort of a walker's command.
_ZERO = NO_TORQUE.position


@runtime_checkable
class Walker(Protocol):
    """
    A controller that walks in place of the gait; joints are in its own order.

    `default` (n,) is the pose in which it begins [rad]. `ranges` are those of the velocities that
    it knows, or None. `failure` is '' while all is well. A walker may have `due_after`, how
    long after its last step [s] the next one is due: nobody steps it before, its targets stay.
    """

    joints: tuple[str, ...]
    default: np.ndarray
    ranges: tuple[tuple[float, float], ...] | None

    @property
    def failure(self) -> str:
        """Why it cannot go on."""

    def reset(self) -> None:
        """Forget the past."""

    def step(self, senses: Senses, command: np.ndarray, dt: float) -> JointTargets:
        """Return joint targets, `dt` [s] after the step before; `command` (3,) is a velocity."""


@jit
def _feel_feet(
    trust: np.ndarray, robot: np.ndarray, ground: np.ndarray, rules: np.ndarray, dt: float
) -> None:
    """
    Trust feet (4,) that touch, more with time: no schedule says which stand.

    Those that are trusted wholly tell where the ground is, a flat `Plane`.
    """
    own, radius = robot[0], rules[0].geometry.foot_radius
    points, tells = np.empty((4, 3)), np.zeros(4, dtype=np.bool_)
    for i in range(4):
        trust[i] = min(trust[i] + dt / TRUST_TIME, 1.0) if own.is_contact[i] else 0.0
        tells[i] = trust[i] == 1.0
        for k in range(3):
            points[i, k] = own.feet[i, k] - (radius if k == 2 else 0.0)
    follow_plane(ground, points, tells, rules, dt)


@jit
def _write_senses(
    robot: np.ndarray, joints: np.ndarray, turns: np.ndarray, out: np.ndarray
) -> None:
    """
    Write velocity in base axes (3,), then positions and velocities of a walker's `joints` (n,).

    `turns` (2, 12) are signs and zeros of the leg angles.
    """
    own, count = robot[0], len(joints)
    for k in range(3):
        out[k] = 0.0
        for i in range(3):
            out[k] += own.base.velocity[i] * own.base.R[i, k]
    for n in range(count):
        j = joints[n]
        out[3 + n] = turns[0, j] * (own.joint_position[j] - turns[1, j])
        out[3 + count + n] = turns[0, j] * own.joint_velocity[j]


class Policy(AfterTrot, Trotting):
    """
    The walker drives the legs; sticks and velocity commands drive the walker.

    It begins at rest, in its own pose. It knows what a robot knows: joints, IMU, estimated
    velocity.
    """

    def __init__(self, parts: ControllerParts, walker: Walker) -> None:
        """
        Take a walker whose joints are this robot's, and its pose, a number for each of them.

        Raises:
            UserError: they are not.
        """
        super().__init__(parts)
        self._walker = walker
        quadruped = parts.model.quadruped
        names = list(quadruped.joint_names)
        for name in walker.joints:
            if name not in names:
                raise UserError(f'policy: joint {name} is not in this robot{suggest(name, names)}')
        if len(walker.joints) != len(names):
            raise UserError(f'policy: got {len(walker.joints)} joints, wanted {len(names)}')
        if missing := set(names) - set(walker.joints):
            raise UserError(f'policy: joints: {min(missing)} is missing, another is there twice')
        check('policy: ranges', walker.ranges, RANGES | None)
        # From the robot's joints to the walker's, and back.
        self._theirs = np.array([names.index(name) for name in walker.joints])
        self._ours = np.argsort(self._theirs)
        self._sign, self._zero = quadruped.sign, quadruped.zero
        check('policy: default', walker.default, GenericAlias(tuple, (float,) * len(names)))
        self._turns = np.stack((self._sign, self._zero))
        self._low, self._high = command_bounds(walker.ranges)
        # What is compiled is loaded now, not while the robot stands and waits.
        blank = RobotState.blank().flat
        self._feel(np.zeros(4), blank, 0.0)
        self._sense(blank)

    @property
    def failure(self) -> str | None:
        """Why the walker cannot go on."""
        return self._walker.failure or None

    def _rest(self, robot: RobotState) -> None:
        """Go to the walker's pose first; the command is zero once the trot has halted."""
        super()._rest(robot)
        if not self._parts.locomotion.gait.is_stepping:
            self._parts.command_filter.reset()
            self._parts.locomotion.reset(robot)
        self._walker.reset()  # which may choose the pose
        pose = np.asarray(self._walker.default, float)
        if pose.shape != self._ours.shape:
            raise ValueError(f'policy: default: got shape {pose.shape}, wanted {self._ours.shape}')
        self._default = self._sign * pose[self._ours] + self._zero
        self._held: JointCommand | None = None
        self._waited = 0.0  # since the walker's last step [s]
        self._used_sticks = False
        self._moved = [0.0, 0.0, 0.0]  # what comes out, averaged
        self._behind = [0.0, 0.0, 0.0]  # for how long a command has not been followed [s]
        self._is_told = [False, False, False]

    @property
    def due_after(self) -> float:
        """How long after the last step the next one is due [s]: targets stay meanwhile."""
        return (
            0.0 if self._held is None else min(LOOK_PERIOD, self._walker_due_after - self._waited)
        )

    @property
    def _walker_due_after(self) -> float:
        """What the walker says, NaN where that is no number: a step is then due, and fails."""
        try:
            return float(getattr(self._walker, 'due_after', 0.0))
        except (TypeError, ValueError):
            return math.nan

    @property
    def _may_step(self) -> bool:
        return False

    def _at_rest(self, robot: RobotState, dt: float) -> JointCommand:
        """Go to the pose, or let the walker walk."""
        self._time += dt
        if self._time < SETTLE_TIME:
            self._parts.command_filter.step(dt, may_go=False)  # a request gets older
            share = smooth(self._time / SETTLE_TIME)
            pose = self._start + share * (self._default - self._start)
            return stiff_command(self._parts.model, pose)
        self._feel(self.trust, robot.flat, dt)
        self._waited += dt
        if self._held is None or not self._waited <= self._walker_due_after - ROUNDING:
            self._held = self._walk(robot, self._waited)
            self._waited = 0.0
        return self._held

    def _walk(self, robot: RobotState, dt: float) -> JointCommand:
        """
        Step the walker, `dt` [s] after its last step.

        Raises:
            ValueError: it gives no targets of this robot, or no time for its next step.
        """
        self._read_command()
        asked = self._parts.command_filter
        asked.velocity = None
        command = np.minimum(np.maximum(asked.step(dt), self._low), self._high)
        moves, *joints = self._sense(robot.flat)
        omega = robot.base.omega
        self._watch([*moves[:2].tolist(), float(omega[2])], command.tolist(), dt)
        senses = Senses(robot.orientation, omega, moves, *joints)
        given = self._walker.step(senses, command, dt)
        targets = [np.asarray(each, float) for each in given] if np.iterable(given) else []
        shapes, wanted = [each.shape for each in targets], self._ours.shape
        if shapes != [wanted] * 3:
            raise ValueError(f'policy: got targets of shapes {shapes}, wanted 3 of {wanted}')
        if math.isnan(self._walker_due_after):
            due = shown(self._walker.due_after)  # type: ignore[attr-defined]
            raise ValueError(f'policy: due_after: got {due}, wanted a number of seconds')
        position, kp, kd = targets
        position = self._sign * position.take(self._ours) + self._zero
        return JointCommand(position, _ZERO, _ZERO, kp.take(self._ours), kd.take(self._ours))

    def _feel(self, trust: np.ndarray, robot: np.ndarray, dt: float) -> None:
        locomotion = self._parts.locomotion
        _feel_feet(trust, robot, locomotion.ground.flat, locomotion.rules, dt)

    def _sense(self, robot: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return velocity in base axes (3,), positions and velocities of the walker's joints."""
        count = len(self._theirs)
        known = np.empty(3 + 2 * count)
        _write_senses(robot, self._theirs, self._turns, known)
        return known[:3], known[3 : 3 + count], known[3 + count :]

    def _read_command(self) -> None:
        """Ask for what the sticks say once they have been moved; else cmd_vel asks."""
        sticks = self._parts.sticks.values
        is_held = any((sticks.lx, sticks.ly, sticks.rx))
        if is_held or self._used_sticks:
            super()._read_command()
        self._used_sticks = is_held

    def _watch(self, moves: list[float], command: list[float], dt: float) -> None:
        """Say once of each direction, ahead, left and turn, that the walker does not follow it."""
        share = min(dt / AVERAGE_TIME, 1.0)
        # In plain numbers: numpy takes ten times as long for three of them.
        for axis, (now, asked) in enumerate(zip(moves, command, strict=True)):
            self._moved[axis] += share * (now - self._moved[axis])
            ahead = math.copysign(self._moved[axis], self._moved[axis] * asked)
            is_behind = abs(asked) > LEAST[axis] and ahead < SHARE * abs(asked)
            self._behind[axis] = self._behind[axis] + dt if is_behind else 0.0
            if self._behind[axis] > NOT_FOLLOWED_TIME and not self._is_told[axis]:
                self._is_told[axis] = True
                self._parts.remark = self._words(axis, asked)

    def _words(self, axis: int, command: float) -> str:
        name, unit = AXES[axis]
        known = ''
        if self._walker.ranges is not None:
            known = '; trained for {:g} to {:g}'.format(*self._walker.ranges[axis])
        return (
            f'the policy does not follow {name} {command:+.2f} {unit}: '
            f'{self._moved[axis]:+.2f}{known}'
        )
