# SPDX-License-Identifier: Apache-2.0
"""On the ground and up from it: get up from any pose, key 6, and lie down gently, key 7."""

from enum import auto, Enum
import math
from typing import NamedTuple

import numpy as np
from robot_description.morphology.quadruped import similar_leg
from wasd_core.robot_io import JointCommand

from quadruped_sim.leg_kinematics import FRONT, LEFT
from quadruped_sim.robot_model import NO_TORQUE, RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.driving import (
    AfterTrot,
    approach,
    ControllerParts,
    smooth,
    State,
    stiff_command,
)


class Roll(NamedTuple):
    """
    Two poses that roll a folded robot off its back or its right side onto its belly.

    Of each: hip, thigh and calf of a Go2's left legs, then of its right legs [rad]; and `times`,
    how long each is held [s].
    """

    poses: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]
    times: tuple[float, float]


# Off the back: the folded legs of one side point past it, then stretch and sweep inward, until
# the trunk tips over the hips of the other side. Off the side: the lower legs push the back up.
# Twice it leads from the back onto the belly. It needs time, not speed: for heavy robots.
_TIP = Roll(
    (
        ((0.0, 1.36, -2.65), (0.0, 3.40, -2.55)),
        ((0.0, 1.36, -2.65), (-0.6, 3.40, -0.70)),
    ),
    (0.5, 0.5),
)
# Taken in turn. Evolution strategies of 12 samples a round found the first two, which are quick:
# on level ground, boxes of 5 cm and 10 degrees.
ROLLS = (
    Roll(
        (
            ((0.67, 3.31, -2.15), (-0.91, 2.03, -0.98)),
            ((0.41, 0.93, -2.15), (-0.86, 3.13, -2.59)),
        ),
        (0.29, 0.24),
    ),
    Roll(
        (
            ((0.44, 3.34, -1.89), (-0.88, 2.93, -1.45)),
            ((0.72, 2.02, -1.39), (-0.72, 3.01, -2.40)),
        ),
        (0.37, 0.26),
    ),
    _TIP,
    _TIP,
)
# Stiffness [N m/rad], damping [N m s/rad] and speed [rad/s] of the joints meanwhile.
_KP, _KD, _RATE = 100.0, 4.0, 10.0
# Folded is so close to it [rad] for so long [s], or as close as it gets within so long [s].
_NEAR, _AT_REST, _SETTLED, _FOLD_TIME_MAX = 0.35, 1.0, 0.1, 1.2
# Cosines of the tilt up to which it stands up, and beyond which that has failed.
_UPRIGHT, _TIPPED = 0.8, 0.6
# Sine of the roll from which on it lies on that side; less is on its back.
_ON_SIDE = 0.4
# A stage of freeing a leg takes so long [s].
_FREE_TIME = 1.0
# Joints that reach the poses but for so much may roll a robot over [rad].
_SHORT = 0.8
# So often it is tried.
TRIES_MAX = 8
# How long a Go2 takes [s]; all times here are one's.
_STAND_TIME, _LIE_TIME = 1.0, 2.0


class Stage(Enum):
    """Where on its way up a robot is."""

    FOLD = auto()
    STRETCH = auto()
    TURN_UPRIGHT = auto()
    SWING_OUT = auto()
    FIRST_POSE = auto()
    SECOND_POSE = auto()
    STAND = auto()


# By which it frees legs.
_FREEING = (Stage.STRETCH, Stage.TURN_UPRIGHT, Stage.SWING_OUT)


class GetUp(State):
    """
    From any pose to a stand: folds its legs, rolls until it is upright, stands up.

    Where hips turn all round, a leg may be hooked to the trunk, its knee on the wrong side. Such
    legs do not fold, as that pulls them tight: they stretch away from the trunk, forward or
    backward, and turn on. What stays hooked swings out around its hip. By turns with rolling.

    It looks at joint positions and at which way is up, alone [cf. Cheetah-Software's recovery
    stand]. What did not bring a robot off its back is repeated to the other side.
    """

    may_be_low = True

    def __init__(self, parts: ControllerParts) -> None:
        super().__init__(parts)
        self._folded = parts.model.folded_pose
        self._rolling = {
            side: [rolling_poses(parts.model, roll, side) for roll in ROLLS] for side in (1, -1)
        }
        self._target = self._start = self._folded
        self._rested = 0.0
        self._freed, self._was_freed = self._folded, False
        self._position = self._folded

    @property
    def is_lying(self) -> bool:
        """Whether it is not yet on its feet."""
        return self._stage is not Stage.STAND

    @property
    def failure(self) -> str | None:
        """Whether all that rolling, and standing up only to tip over, has been of no use."""
        tries = max(self._rolls - 1, 0) + self._tips
        if tries < TRIES_MAX:
            return None
        if self._tips:
            return f'{tries} tries have not got it on its feet'
        return f'{tries} rolls have not turned it over'

    @property
    def is_over(self) -> bool:
        """Whether it stands."""
        return self._stage is Stage.STAND and self._time >= _STAND_TIME

    def enter(self, robot: RobotState) -> None:
        """Fold, from wherever the joints are."""
        self._parts.locomotion.gait.reset()
        self._target = self._position = robot.joint_position.copy()
        self._side = self._rolls = self._tips = 0  # none yet
        self._was_freed = False
        self._begin(Stage.FOLD)

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Go toward the pose of this stage, or of the next when its time has come."""
        self._time += dt / self._parts.model.scale.of('s')
        up = robot.base.R[2]
        if self._stage is Stage.FOLD:
            near = float(np.abs(robot.joint_position - self._folded).max()) < _NEAR
            turning = math.hypot(*robot.base.omega.tolist()) / self._parts.model.scale.of('rad/s')
            if not near or turning > _AT_REST:
                self._rested = self._time
            if self._time - self._rested > _SETTLED or self._time > _FOLD_TIME_MAX:
                self._leave_fold(robot.joint_position, up, near)
        elif self._stage is Stage.STAND:
            if up[2] < _TIPPED:
                self._tips += 1
                self._begin(Stage.FOLD)
        elif self._stage in _FREEING:
            if self._time > _FREE_TIME:
                self._go_on_freeing(robot.joint_position)
        elif self._time > ROLLS[self._roll].times[self._stage is Stage.SECOND_POSE]:
            is_first = self._stage is Stage.FIRST_POSE
            self._begin(Stage.SECOND_POSE if is_first else Stage.FOLD)
        if self._stage is Stage.STAND:
            share = smooth(self._time / _STAND_TIME)
            self._target = self._start + share * (self._parts.model.standing_pose - self._start)
            return stiff_command(self._parts.model, self._target.copy())
        return self._move(robot, dt)

    @property
    def _roll(self) -> int:
        """Which of the rolls it is."""
        return (self._rolls - 1) % len(ROLLS)

    def _begin(self, stage: Stage) -> None:
        self._stage, self._time, self._rested = stage, 0.0, 0.0
        self._start = self._target.copy()

    def _go_on_freeing(self, position: np.ndarray) -> None:
        """Turn the hips of stretched legs upright, swing out those still hooked, and fold."""
        self._target, is_hooked = position.copy(), hooked(position)
        if self._stage is Stage.STRETCH:
            upright = np.where(np.arange(12) % 3 == 0, self._folded, self._freed)
            self._freed = nearest(upright, position)
            self._begin(Stage.TURN_UPRIGHT)
        elif self._stage is Stage.TURN_UPRIGHT and is_hooked.any():
            self._freed = swung_out(self._folded, position, is_hooked)
            self._begin(Stage.SWING_OUT)
        else:
            self._begin(Stage.FOLD)

    def _leave_fold(self, position: np.ndarray, up: np.ndarray, is_folded: bool) -> None:
        """
        Stand up, or roll over the side that is down; `up` (3,) is in base axes.

        A leg that the trunk lies on does not fold: rolling frees that, too.
        """
        if up[2] > _UPRIGHT and is_folded:
            self._begin(Stage.STAND)
            return
        is_hooked = hooked(position)
        self._was_freed = bool(is_hooked.any()) and not self._was_freed
        if self._was_freed:
            self._freed = nearest(stretched(self._folded, position, is_hooked), self._target)
            self._begin(Stage.STRETCH)
            return
        if self._side == 0 or abs(float(up[1])) > _ON_SIDE:
            self._side = 1 if up[1] > 0.0 else -1
        else:
            self._side = -self._side
        self._rolls += 1
        self._begin(Stage.FIRST_POSE)

    def _move(self, robot: RobotState, dt: float) -> JointCommand:
        """Lead the joints to this stage's pose, with no more torque than the motors have."""
        goal = self._folded
        # A reading leaves whole turns out: where it jumps, so does what is aimed at.
        jump = math.tau * np.round((robot.joint_position - self._position) / math.tau)
        self._position = robot.joint_position.copy()
        self._target, self._freed = self._target + jump, self._freed + jump
        if self._stage in _FREEING:
            goal = self._freed
        elif self._stage is Stage.FOLD:
            # Folding would pull a hooked leg tight.
            goal = np.where(np.repeat(hooked(robot.joint_position), 3), self._target, goal)
        else:
            goal = self._rolling[self._side][self._roll][self._stage is Stage.SECOND_POSE]
        model, scale = self._parts.model, self._parts.model.scale
        most = np.full(12, _RATE * scale.of('rad/s') * dt)
        self._target = approach(self._target, goal, most)
        off = self._target - robot.joint_position
        kp, kd = _KP * scale.of('N m/rad'), _KD * scale.of('N m s/rad')
        damping, limit = kd * robot.joint_velocity, model.limits.effort
        torque = kp * off
        torque = np.clip(torque, damping - limit, damping + limit)
        return NO_TORQUE._replace(
            position=robot.joint_position + torque / kp, kp=np.full(12, kp), kd=np.full(12, kd)
        )


def stretched(folded: np.ndarray, position: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """
    Return leg angles (12,): folded, but chosen legs (4,) stretch ahead or back, off the trunk.

    Their hips turn on, until the legs hang upside down: back, knees press against the trunk.
    """
    pose = folded.reshape(4, 3).copy()
    for leg in np.flatnonzero(chosen):
        upside_down = math.copysign(math.pi, position[3 * leg])
        pose[leg] = upside_down, -0.5 * math.pi * FRONT[leg], 0.0
    return pose.ravel()


def nearest(goal: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return leg angles (12,), each whole turns off so that it is nearest to `near`."""
    turned: np.ndarray = goal - math.tau * np.round((goal - near) / math.tau)
    return turned


def hooked(position: np.ndarray) -> np.ndarray:
    """Which legs (4,) at these leg angles (12,) have their hips upside down."""
    is_hooked: np.ndarray = np.cos(position[::3]) < 0.0
    return is_hooked


def swung_out(folded: np.ndarray, position: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """
    Return leg angles (12,): folded, but chosen legs (4,) keep their pose and turn hips upright.

    Seen along the trunk, half a turn of a hip leads its leg through the trunk: that way it is not.
    """
    pose = folded.reshape(4, 3).copy()
    for leg in np.flatnonzero(chosen):
        hip, thigh, calf = position[3 * leg : 3 * leg + 3]
        turned = math.remainder(hip, math.tau)
        is_outside = LEFT[leg] * turned * math.cos(thigh) > 0.0
        on = 0.0 if is_outside else math.copysign(math.tau, turned)
        pose[leg] = hip - turned + on, thigh, calf
    return pose.ravel()


def rolling_poses(model: RobotModel, roll: Roll, side: int) -> tuple[np.ndarray, ...]:
    """Leg angles (12,) of the poses that roll a robot over its left (1) or right (-1) side."""
    poses = []
    for pose in roll.poses:
        angles = np.empty((4, 3))
        for leg, left in enumerate(LEFT):
            hip, thigh, calf = pose[0 if left == side else 1]
            angles[leg] = similar_leg(model.quadruped, leg, thigh, calf)
            angles[leg, 0] = side * hip
        poses.append(np.clip(angles.ravel(), model.limits.lower, model.limits.upper))
    return tuple(poses)


def obstacle(model: RobotModel) -> str:
    """Return what keeps a robot from rolling over, a joint's range; '' if none does."""
    poses = rolling_poses(model, ROLLS[0], 1)
    for pose, wanted in zip(poses, ROLLS[0].poses, strict=True):
        asked = np.array([wanted[0 if left == 1.0 else 1] for left in LEFT])
        asked[:, 1:] *= model.geometry.bend[:, None]
        short = np.abs(pose - asked.ravel())
        worst = int(np.argmax(short))
        if short[worst] > _SHORT:
            name = model.quadruped.joint_names[worst]
            return f'{name} ends {short[worst]:.1f} rad short of rolling over'
    return ''


class LieDown(AfterTrot):
    """Folds the legs under a robot that stands, so that it is let go of near the ground."""

    may_be_low = True

    def __init__(self, parts: ControllerParts) -> None:
        super().__init__(parts)
        self._folded = parts.model.folded_pose

    @property
    def is_over(self) -> bool:
        """Whether the legs are folded."""
        return self._time >= _LIE_TIME

    def _at_rest(self, robot: RobotState, dt: float) -> JointCommand:
        """Next point of the way down."""
        self._time += dt / self._parts.model.scale.of('s')
        position = self._start + smooth(self._time / _LIE_TIME) * (self._folded - self._start)
        return stiff_command(self._parts.model, position)
