# SPDX-License-Identifier: Apache-2.0
"""
unitree_guide's three tests of the whole-body QP, keys 0, 9 and 8: balance, swing, step.

Where unitree_guide shifts the base by fixed distances from its place at entry, the centre of mass
is led into the polygon between the feet that stand, as they are measured. All lengths and speeds
here are the Go2's.
"""

from abc import abstractmethod
import math

import numpy as np
from wasd_core.robot_io import JointCommand
from wasd_core.rotations import yaw_matrix

from quadruped_sim.leg_kinematics import FR
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.driving import approach, is_up, OnFeet, smooth
from quadruped_sim.states.support import corners_of, nearest_inside, room_inside

# The centre of mass stays so far inside the edges between four feet [m].
BALANCE_MARGIN = 0.06
# It steps if a foot has lifted off and it rolls or pitches so fast [rad/s].
TURNED_OFF = 1.0
# x, y, z [m] and yaw [rad] of the base at full stick, and how fast it follows, per second.
BALANCE_FULL = np.array((0.05, 0.05, 0.04, math.radians(20.0)))
BALANCE_RATE = np.array((0.1, 0.1, 0.08, 0.7))
# Box of the foot around where it stood, yaw frame [m]: backward/forward, right/left, down/up;
# its speed [m/s].
SWING_LOW = np.array((-0.15, -0.15, -0.05))
SWING_HIGH = np.array((0.10, 0.15, 0.20))
SWING_FOOT_RATE = 0.3
# Before a foot is lifted the centre of mass goes inside the triangle of the three others, by this
# share of the radius of its incircle, at this speed [m/s].
INSIDE = 0.75
SHIFT_RATE = 0.06
# The foot leaves the ground by this much once the centre of mass is so close to its place [m].
SWING_CLEARANCE = 0.03
SHIFTED = 0.015
# A leg is led no farther than this share of its length, and no nearer below its hip than that:
# folded under the belly it pushes against its stops and the trunk, and tips the robot over.
REACH, FOLDED = 0.95, 0.4
# Radius of the incircle of three feet [m] below which all feet are first put below their hips.
NARROW = 0.06
# Legs that are lifted in turn, FR RL FL RR; times [s], and half of how high a foot goes [m].
STEP_ORDER = (1, 2, 0, 3)
STEP_SHIFT_TIME = 1.0
STEP_LIFT_TIME = 1.0
STEP_HALF_HEIGHT = 0.05
_ALL = np.ones(4, dtype=bool)


class Exercise(OnFeet):
    """Starts from where feet and centre of mass are, level; feet that stand badly step first."""

    def _begin_from(self, robot: RobotState) -> None:
        """Remember where it stands."""
        self._size = self._parts.model.scale.of('m')
        self._yaw = float(robot.base.rpy[2])
        self._height = float(robot.base.position[2] - robot.feet[:, 2].mean())
        self._feet = robot.feet.copy()
        self._over = _centre_of_mass(robot)
        self.trust = np.ones(4)
        self._has_squared, is_first = True, not self._has_squared
        narrowest = min(room_inside(corners_of(robot.feet, _but(leg))) for leg in range(4))
        if is_first and narrowest < NARROW * self._size:
            self._start_steps(robot)
        self._prepare(robot)

    def enter(self, robot: RobotState) -> None:
        """Square the feet once at most."""
        self._has_squared = False
        super().enter(robot)

    @abstractmethod
    def _prepare(self, robot: RobotState) -> None:
        """Begin with what this exercise moves."""

    def _hold(
        self, robot: RobotState, yaw: float, is_stance: np.ndarray, feet: np.ndarray, lift: float
    ) -> JointCommand:
        """
        Hold the centre of mass over `self._over` (2,) on the feet of `is_stance` (4,), level.

        The others are led to `feet` (4, 3); the base is `lift` above its height at the start [m].
        """
        com = robot.base.R @ robot.com
        level = float(robot.feet[is_stance, 2].mean()) + self._height + lift
        position = np.array((*(self._over - com[:2]), level))
        return self._stand(robot, position, yaw, is_stance, feet)

    def _place_without(self, leg: int, robot: RobotState) -> np.ndarray:
        """Return where the centre of mass (2,) is over the feet but one [m]."""
        corners = corners_of(robot.feet, _but(leg))
        margin = INSIDE * room_inside(corners)
        return nearest_inside(_centre_of_mass(robot), corners, margin)


class BalanceTest(Exercise):
    """
    Moves the base over four standing feet by forces alone, around the pose at entry.

    ly moves forward, lx right, ry up, rx turns right.
    """

    def _tips(self, robot: RobotState) -> bool:
        # One that turns off a foot is tipped over by what its forces do against a push.
        rate = math.hypot(*robot.base.omega[:2].tolist())
        turns = rate > TURNED_OFF * self._parts.model.scale.of('1/s')
        lifts = turns and not robot.is_contact.all() and is_up(self._parts.model, robot)
        return lifts or super()._tips(robot)

    def _prepare(self, robot: RobotState) -> None:
        self._now, self._centre = np.zeros(4), self._over

    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """Hold the pose that the sticks ask for, with the weight between the feet."""
        sticks = self._parts.sticks.values
        wanted = BALANCE_FULL * np.array((sticks.ly, -sticks.lx, sticks.ry, -sticks.rx))
        size = np.array((self._size, self._size, self._size, 1.0))
        self._now = approach(self._now, wanted * size, dt * BALANCE_RATE * size)
        x, y, lift, turn = self._now.tolist()
        asked = self._centre + yaw_matrix(self._yaw)[:2, :2] @ (x, y)
        corners = corners_of(robot.feet, _ALL)
        inside = nearest_inside(asked, corners, BALANCE_MARGIN * self._size)
        self._over = approach(self._over, inside, np.full(2, dt * self._size * BALANCE_RATE[0]))
        return self._hold(robot, self._yaw + turn, _ALL, robot.feet, lift)


class SwingTest(Exercise):
    """Stands on FL, RL and RR, over which it leans first; ly, lx, ry move the FR foot."""

    def _prepare(self, robot: RobotState) -> None:
        self._foot = np.zeros(3)
        self._goal = self._place_without(FR, robot)

    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """Shift, then swing."""
        size = self._size
        most = np.full(2, dt * size * SHIFT_RATE)
        self._over = approach(self._over, self._goal, most)
        off = math.dist(_centre_of_mass(robot), self._goal)
        if self.trust[FR] == 0.0 or off < size * SHIFTED:
            self.trust = _but(FR).astype(float)
            most = np.full(3, dt * size * SWING_FOOT_RATE)
            self._foot = approach(self._foot, size * self._wanted(), most)
        feet = self._feet.copy()
        feet[FR] = self._within_reach(robot, self._feet[FR] + yaw_matrix(self._yaw) @ self._foot)
        return self._hold(robot, self._yaw, self.trust > 0.0, feet, 0.0)

    def _wanted(self) -> np.ndarray:
        sticks = self._parts.sticks.values
        stick = np.array((sticks.ly, -sticks.lx, sticks.ry))
        wanted = np.where(stick > 0.0, stick * SWING_HIGH, -stick * SWING_LOW)
        wanted[2] = max(float(wanted[2]) + SWING_CLEARANCE, 0.0)
        return np.asarray(wanted)

    def _within_reach(self, robot: RobotState, foot: np.ndarray) -> np.ndarray:
        """Return `foot` (3,) or a point near it that the leg reaches, below its hip [m]."""
        legs = self._parts.model.geometry
        hip = robot.base.position + robot.base.R @ legs.hip[FR]
        way = foot - hip
        length = legs.thigh[FR] + legs.calf[FR]
        way[2] = min(float(way[2]), -FOLDED * length)
        most = REACH * math.hypot(length, legs.offset[FR])
        return np.asarray(hip + way * min(most / max(math.hypot(*way.tolist()), 1e-9), 1.0))


class StepTest(Exercise):
    """
    Lifts one foot after the other by 10 cm, leaning over the three that stand.

    Height h(t) = 0.05 (1 - cos), as unitree_guide's.
    """

    def _prepare(self, robot: RobotState) -> None:
        self._turn, self._is_lifting = 0, False
        self._lean(robot)

    def _lean(self, robot: RobotState) -> None:
        """Begin to lean over the feet but the one whose turn it is."""
        self._leg = STEP_ORDER[self._turn % 4]
        self._from, self._goal = self._over, self._place_without(self._leg, robot)
        self._time = 0.0

    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """Lean for a time, then lift and lower one foot."""
        self._time += dt
        size, feet = self._size, self._feet.copy()
        if self._is_lifting and self._time > STEP_LIFT_TIME:
            self._turn, self._is_lifting = self._turn + 1, False
            self._lean(robot)
        off = math.dist(_centre_of_mass(robot), self._goal)
        if not self._is_lifting and self._time > STEP_SHIFT_TIME and off < size * SHIFTED:
            self._is_lifting, self._time = True, 0.0
        if self._is_lifting:
            angle = 2.0 * math.pi * self._time / STEP_LIFT_TIME
            feet[self._leg, 2] += size * STEP_HALF_HEIGHT * (1.0 - math.cos(angle))
            is_stance = _but(self._leg)
        else:
            self._feet[robot.is_contact] = robot.feet[robot.is_contact]
            share = smooth(self._time / STEP_SHIFT_TIME)
            self._over = self._from + share * (self._goal - self._from)
            is_stance = _ALL
        self.trust = is_stance.astype(float)
        return self._hold(robot, self._yaw, is_stance, feet, 0.0)


def _but(leg: int) -> np.ndarray:
    """Return which feet stand (4,) when all do but one."""
    return np.asarray(np.arange(4) != leg)


def _centre_of_mass(robot: RobotState) -> np.ndarray:
    """Return where the whole robot's centre of mass is, from above, world (2,) [m]."""
    return np.asarray((robot.base.position + robot.base.R @ robot.com)[:2])
