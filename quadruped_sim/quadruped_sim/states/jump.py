# SPDX-License-Identifier: Apache-2.0
"""A jump from the stand, in place or ahead, key v."""

from enum import auto, Enum
import math

import numpy as np
from wasd_core.robot_io import GRAVITY, JointCommand
from wasd_core.rotations import yaw_matrix

from quadruped_sim.leg_kinematics import all_leg_angles, foot_positions, leg_motion
from quadruped_sim.locomotion.feedback import pd_law, rotation_error
from quadruped_sim.robot_model import NO_TORQUE, RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.driving import ControllerParts, OnFeet, smooth, stiff_command

# Of the Go2. How far the hips are above the feet: crouched, at take-off, with folded legs in the
# air, with legs held ready for the ground, and at rest again [m].
CROUCHED, EXTENDED, TUCKED, READY, LANDED = 0.15, 0.32, 0.14, 0.26, 0.28
# How long it crouches, and is a spring after it has landed [s].
CROUCH_TIME, LAND_TIME = 0.4, 0.6
# How long feet that have come down give way, and do not tell how the base moves [s].
SETTLING_TIME = 0.1
# Pitch rate at take-off per speed upward [rad/m]: the thighs take it along as they stop.
PITCHING = 0.7
# How long after take-off the legs are limp, so that they do not push any more [s].
LIMP_TIME = 0.03
# Share of the flight after which the legs are held ready.
READY_SHARE = 0.5
# Rows position, velocity, rotation, rate: of the base on its way up, and when it has landed.
_PUSH_GAINS = np.array(((60.0,) * 3, (12.0,) * 3, (150.0,) * 3, (18.0,) * 3))
_LAND_GAINS = np.array(((60.0,) * 3, (14.0,) * 3, (150.0,) * 3, (18.0,) * 3))
# Stiffness [N m/rad] and damping [N m s/rad] of the legs in the air.
_KP, _KD = 60.0, 2.0


# Share of the speed upward, at which its motors turn freely as it takes off, that a robot reaches;
# and from which share on they fade, so that more must be asked for to get it, by the square.
SPEED_SHARE = 0.9
_FADING, _FADED = 0.63, 2.1
# Of a Go2 in place: how far ahead it comes down per speed upward beyond that [m s/m], [m/s].
_DRIFT, _DRIFT_FROM = 0.17, 1.4
# Share of the way asked for that it comes, ahead and back.
_AHEAD, _BACK = 0.95, 0.76


class Stage(Enum):
    """Where in its jump a robot is."""

    CROUCH = auto()
    PUSH = auto()
    FLIGHT = auto()
    LAND = auto()


class Jump(OnFeet):
    """
    Crouches, pushes off, folds its legs, lands as a spring.

    It pushes off with constant acceleration v^2 / 2 D over the way D from the crouch, v the speed
    that carries it as high as it is to go [cf. Chignoli2021]: that of a ball thrown upward.
    """

    def __init__(self, parts: ControllerParts) -> None:
        super().__init__(parts)
        self._fastest, self._highest = fastest(parts.model), highest(parts.model)

    def enter(self, robot: RobotState) -> None:
        """Crouch from where it stands."""
        self._stage = Stage.CROUCH
        super().enter(robot)

    def _begin_from(self, robot: RobotState) -> None:
        """Crouch first."""
        self._stage = Stage.CROUCH

    @property
    def may_be_low(self) -> bool:
        """Whether it crouches or flies."""
        return self._stage is not Stage.LAND

    @property
    def _may_step(self) -> bool:
        return self._stage is Stage.CROUCH

    @property
    def is_over(self) -> bool:
        """Whether it has landed and rests."""
        return self._stage is Stage.LAND and self._time > LAND_TIME * self._scale('s')

    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """One tick of the present stage."""
        self._time += dt
        if self._stage is Stage.CROUCH and self._time > CROUCH_TIME * self._scale('s'):
            self._begin(Stage.PUSH, robot)
        elif self._stage is Stage.PUSH and self._is_off(robot):
            self._begin(Stage.FLIGHT, robot)
        elif self._stage is Stage.FLIGHT and self._is_down(robot):
            self._begin(Stage.LAND, robot)
        if self._stage is Stage.CROUCH:
            share = smooth(self._time / (CROUCH_TIME * self._scale('s')))
            model = self._parts.model
            ahead = self._ahead() + float(robot.com[0] - model.hips[0])
            crouched = _pose(model, CROUCHED, ahead)
            position = self._start + share * (crouched - self._start)
            return stiff_command(self._parts.model, position)
        if self._stage is Stage.PUSH:
            return self._push(robot)
        return self._fly() if self._stage is Stage.FLIGHT else self._land(robot)

    def _begin(self, stage: Stage, robot: RobotState) -> None:
        self._stage, self._time = stage, 0.0
        self.trust = np.full(4, 1.0 if stage is Stage.PUSH else 0.0)
        self._from = robot.base.position.copy()
        if stage is Stage.PUSH:
            self._yaw = float(robot.base.rpy[2])

    def _take_off(self) -> tuple[float, float, float]:
        """
        Return speeds ahead and upward to ask for at take-off [m/s], and the time of flight [s].

        Motors that fade give less than they are asked for.
        """
        jump = self._parts.params.jump
        share = min(self._highest / jump.height, 1.0)  # of what is asked for
        up = math.sqrt(2.0 * GRAVITY * share * jump.height)
        drop = (EXTENDED - LANDED) * self._scale('m')
        flight = (up + math.sqrt(up * up + 2.0 * GRAVITY * drop)) / GRAVITY
        faded = up / self._fastest - _FADING
        # Motors without a limit of speed (infinite) lose nothing.
        asked = up if faded <= 0.0 else up + _FADED * faded * faded * self._fastest
        drift = _DRIFT * self._scale('s') * max(up - _DRIFT_FROM * self._scale('m/s'), 0.0)
        way = share * jump.distance / (_AHEAD if jump.distance > 0.0 else _BACK) - drift
        ahead = way / (flight + 0.5 * self._push_time(asked))
        return ahead, asked, flight

    def _push_time(self, up: float) -> float:
        return 2.0 * (EXTENDED - CROUCHED) * self._scale('m') / up

    def _ahead(self) -> float:
        """How far the feet are ahead of the hips in the crouch: half the way of the push [m]."""
        ahead, up, _ = self._take_off()
        return 0.25 * ahead * self._push_time(up)

    def _is_off(self, robot: RobotState) -> bool:
        _, up, _ = self._take_off()
        risen = float(robot.base.position[2] - self._from[2])
        late = self._time > 1.5 * self._push_time(up)
        return late or risen > (EXTENDED - CROUCHED) * self._scale('m')

    def _is_down(self, robot: RobotState) -> bool:
        flight = self._take_off()[2]
        felt = self._time > 0.5 * flight and int(robot.is_contact.sum()) >= 2
        return felt or self._time > 2.0 * flight

    def _push(self, robot: RobotState) -> JointCommand:
        """Accelerate the base evenly, level, along the way that leads to the take-off."""
        ahead, up, _ = self._take_off()
        time = self._push_time(up)
        direction = yaw_matrix(self._yaw)
        speed = direction @ np.array((ahead, 0.0, up))
        now = min(self._time, time)
        way = self._from + 0.5 * now * now / time * speed
        turn = np.array((0.0, PITCHING * self._scale('rad/m') * up, 0.0))
        level = np.array((0.0, 0.0, self._yaw))
        share = now / time
        rpy, rates = level + 0.5 * now * share * turn, share * direction @ turn
        acceleration = self._feedback(_PUSH_GAINS, robot, way, share * speed, rpy, rates)
        acceleration += np.concatenate((speed, direction @ turn)) / time
        command = self._by_all(robot, acceleration)
        # The motors shall not damp the motion that they make.
        return command._replace(velocity=robot.joint_velocity.copy())

    def _fly(self) -> JointCommand:
        """Fold the legs, then hold them ready, ahead of the hips as far as it flies on."""
        ahead, _, flight = self._take_off()
        is_ready = self._time > READY_SHARE * flight
        position = _pose(
            self._parts.model, READY if is_ready else TUCKED, 0.1 * ahead * self._scale('s')
        )
        kp = np.full(12, _KP * self._scale('N m/rad'))
        kd = np.full(12, _KD * self._scale('N m s/rad'))
        if self._time < LIMP_TIME * self._scale('s'):
            kp, kd = np.zeros(12), 0.1 * kd
        return NO_TORQUE._replace(position=position, kp=kp, kd=kd)

    def _land(self, robot: RobotState) -> JointCommand:
        """Bring the base to rest over the feet, as a damped spring does."""
        contact = self._parts.params.contact
        felt = (robot.normal_forces - contact.force_off) / (contact.force_on - contact.force_off)
        if self._time > SETTLING_TIME * self._scale('s'):
            self.trust = np.clip(felt, 0.0, 1.0)
        middle = robot.feet.mean(axis=0)
        middle[2] = float(robot.feet[:, 2].min()) + LANDED * self._scale('m')
        middle -= yaw_matrix(self._yaw) @ self._parts.model.hips
        rpy, rest = np.array((0.0, 0.0, self._yaw)), np.zeros(3)
        acceleration = self._feedback(_LAND_GAINS, robot, middle, rest, rpy, rest)
        return self._by_all(robot, acceleration)

    def _by_all(self, robot: RobotState, acceleration: np.ndarray) -> JointCommand:
        """Accelerate the base with all feet; asked for too much, all legs lack the same."""
        stance = np.ones(4, dtype=bool)
        # Other forces, which spare the motors of some legs, would turn it.
        return self._by_forces(robot, acceleration, stance, spares_motors=False)

    def _feedback(
        self,
        gains: np.ndarray,
        robot: RobotState,
        position: np.ndarray,
        velocity: np.ndarray,
        rpy: np.ndarray,
        rates: np.ndarray,
    ) -> np.ndarray:
        """Acceleration (6,) of the base toward where it shall be and how it shall move, world."""
        units = np.tile((self._scale('1/s^2'), self._scale('1/s')), 2)[:, None]
        base = robot.base
        return pd_law(
            gains * units,
            position - base.position,
            velocity - base.velocity,
            rotation_error(rpy, base.R),
            rates - base.R @ base.omega,
        )

    def _scale(self, unit: str) -> float:
        return self._parts.model.scale.of(unit)


def _pose(model: RobotModel, height: float, ahead: float = 0.0) -> np.ndarray:
    """Leg angles (12,), hips a Go2's `height` above the feet, those `ahead` [m] of the hips."""
    feet = foot_positions(model.geometry, model.standing_pose)
    feet[:, 0] += ahead
    feet[:, 2] = float(model.hips[2]) - height * model.scale.of('m')
    limits = model.limits
    angles = all_leg_angles(model.geometry, feet)
    return np.asarray(np.clip(angles, limits.lower, limits.upper))


def fastest(model: RobotModel) -> float:
    """Return the speed upward at take-off at which a thigh or knee turns freely [m/s]."""
    jacobian = leg_motion(model.geometry, _pose(model, EXTENDED), np.zeros(12)).jacobian
    rates = np.abs([np.linalg.solve(leg, (0.0, 0.0, -1.0)) for leg in jacobian])
    speeds = model.limits.velocity.reshape(4, 3) / np.maximum(rates, 1e-9)
    return float(speeds[:, 1:].min())


def highest(model: RobotModel) -> float:
    """
    Return how high the base can rise above its take-off, by the motors [m].

    Their speed bounds how fast it takes off, their torque how fast it gains that from the crouch.
    """
    by_speed = (SPEED_SHARE * fastest(model)) ** 2 / (2.0 * GRAVITY)
    jacobian = leg_motion(model.geometry, _pose(model, CROUCHED), np.zeros(12)).jacobian
    load = 0.25 * model.weight * np.abs(jacobian[:, 2]).reshape(4, 3)
    strength = float((model.limits.effort.reshape(4, 3) / np.maximum(load, 1e-9))[:, 1:].min())
    way = (EXTENDED - CROUCHED) * model.scale.of('m')
    return max(min(by_speed, (strength - 1.0) * way), 0.0)
