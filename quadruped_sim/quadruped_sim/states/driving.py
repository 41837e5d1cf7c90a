# SPDX-License-Identifier: Apache-2.0
"""The base class of states, and the states for standing, leaning and walking."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
import math

import numpy as np
from robot_description.morphology.quadruped import Scale, similar_pose
from wasd_core.robot_io import GRAVITY, JointCommand
from wasd_core.rotations import rotation_vector, rpy_matrix

from quadruped_sim.command_filter import CommandFilter
from quadruped_sim.keys import Sticks
from quadruped_sim.leg_kinematics import all_leg_angles, foot_positions
from quadruped_sim.locomotion.feedback import base_acceleration, standing_forces
from quadruped_sim.locomotion.locomotion import Locomotion
from quadruped_sim.locomotion.swing import foot_velocities
from quadruped_sim.locomotion.whole_body import WholeBodyTask
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import NO_TORQUE, RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.safety import UP
from quadruped_sim.states.support import is_to_step

# On the Go2: acceleration of a led foot per position error [1/s^2] and per velocity [1/s],
_FOOT_GAINS = (300.0, 30.0)
# and motor-side damping [N m s/rad].
_LED_DAMPING = 0.5
# unitree_guide damps with 8 in simulation and 3 on the robot [N m s/rad].
_LIMP_DAMPING = 8.0


@dataclass
class ControllerParts:
    """
    What states use of the controller; made once and shared. `params` may be replaced.

    `is_fed_slowly` tells that readings come too slowly for a trot. `remark` is what a state has to
    tell the driver. `walks_on` says that a walker other than the gait is left while it moves.
    """

    model: RobotModel
    params: LegControllerParameters
    locomotion: Locomotion
    command_filter: CommandFilter
    sticks: Sticks
    is_fed_slowly: bool = False
    remark: str = ''
    walks_on: bool = False


class State(ABC):
    """
    One behaviour. `enter` starts it, `step` is one tick of it.

    `trust` (4,) in [0, 1] says how surely each foot stands, for the estimator.
    """

    def __init__(self, parts: ControllerParts) -> None:
        self._parts = parts
        self.trust = np.ones(4)

    @property
    def is_lying(self) -> bool:
        """Whether the robot lies, or rolls, so that feet do not tell how it moves."""
        return False

    @property
    def may_be_low(self) -> bool:
        """Whether the trunk may be near the ground, as it does not stand or hangs in the air."""
        return False

    @property
    def is_over(self) -> bool:
        """Whether it has done what it does and gives way to its successor, if it has one."""
        return False

    @property
    def failure(self) -> str | None:
        """Why it cannot do what it does, so that the robot goes passive; None while it can."""
        return None

    @abstractmethod
    def enter(self, robot: RobotState) -> None:
        """Start from where the robot is."""

    @abstractmethod
    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Command of this tick, `dt` [s] after the one before."""

    def _stand(
        self,
        robot: RobotState,
        position: np.ndarray,
        yaw: float,
        is_stance: np.ndarray,
        feet: np.ndarray,
    ) -> JointCommand:
        """
        Hold the base level at `position`, `yaw` on the feet of `is_stance` (4,).

        The other feet are led to `feet` (4, 3), world [m]. Level ground is taken.
        """
        scale = self._parts.model.scale
        rules, level = self._parts.locomotion.rules, np.array((0.0, 0.0, yaw))
        acceleration = base_acceleration(rules, robot, position, level)
        stiffness, damping = _FOOT_GAINS[0] * scale.of('1/s^2'), _FOOT_GAINS[1] * scale.of('1/s')
        led = stiffness * (feet - robot.feet) - damping * foot_velocities(robot.flat)
        return self._by_forces(robot, acceleration, is_stance, led)

    def _by_forces(
        self,
        robot: RobotState,
        acceleration: np.ndarray,
        is_stance: np.ndarray,
        led: np.ndarray | None = None,
        *,
        spares_motors: bool = True,
    ) -> JointCommand:
        """
        Give the base an `acceleration` (6,), world axes, by the feet of `is_stance` (4,).

        `led` (4, 3) [m/s^2] are the accelerations of the other feet. Level ground is taken.
        `spares_motors` is as in `WholeBody.solve`.
        """
        model = self._parts.model
        forces = standing_forces(model.weight + model.mass * float(acceleration[2]), is_stance)
        led = np.zeros((4, 3)) if led is None else led
        task = WholeBodyTask(acceleration, is_stance, forces, led, np.eye(3))
        whole_body = self._parts.locomotion.whole_body
        result = whole_body.solve(task, robot, spares_motors=spares_motors)
        return NO_TORQUE._replace(
            position=robot.joint_position.copy(),
            effort=result.torque,
            kd=np.full(12, _LED_DAMPING * model.scale.of('N m s/rad')),
        )


def smooth(share: float) -> float:
    """Return a share of a way that begins and ends at rest, of a share of its time."""
    share = min(share, 1.0)
    return share * share * (3.0 - 2.0 * share)


def approach(value: np.ndarray, target: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Move `value` toward `target` by at most `most`, per element."""
    return np.asarray(value + np.clip(target - value, -most, most))


def damping_command(scale: Scale, joint_position: np.ndarray) -> JointCommand:
    """Damp every joint and nothing else."""
    damping = _LIMP_DAMPING * scale.of('N m s/rad')
    return NO_TORQUE._replace(position=joint_position.copy(), kd=np.full(12, damping))


class Passive(State):
    """
    Damps; the start state, and where every guard leads.

    A robot that a driver lets go of squats first if it is up, so that it does not tip over its
    feet.
    """

    may_be_low = True
    _squatting = 0.0  # for so long from now [s]

    def enter(self, robot: RobotState) -> None:
        """End whatever gait there was, and be limp."""
        self._parts.locomotion.gait.reset()
        self.trust = np.ones(4)
        self.be_limp()

    def be_limp(self) -> None:
        """Damp from now on."""
        self._squatting = 0.0

    def go_down(self, robot: RobotState) -> None:
        """Squat before it is limp if it is up."""
        if is_up(self._parts.model, robot):
            self._squatting = _SQUAT_TIME

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Damping, whatever the pose, or a squat."""
        if self._squatting > 0.0 and robot.base.R[2, 2] > _UPRIGHT:
            self._squatting -= dt / self._parts.model.scale.of('s')
            return squat_command(self._parts.model)
        self.be_limp()
        return damping_command(self._parts.model.scale, robot.joint_position)


STAND_TIME = 2.0
# unitree_guide's simulation gains [N m/rad], [N m s/rad]; its robot gains sag by 8 mm more.
_KP = np.tile((180.0, 180.0, 300.0), 4)
_KD = np.tile((8.0, 8.0, 15.0), 4)
# A trot that has not ended by now is ended anyway [s].
_HALT_TIME_MAX = 3.0
# A squat: hips outward, thighs and calves of a Go2 [rad]; its gains [N m/rad], [N m s/rad]; how
# long it takes from a run [s]. From 45 trots of up to 2 m/s it tipped by 8 degrees at most.
_SQUAT_HIP, _SQUAT_LEG = 0.3, (1.1, -2.2)
_SQUAT_KP, _SQUAT_KD = 60.0, 6.0
_SQUAT_TIME = 0.6
# One that is tilted more than this cosine falls whatever its legs do.
_UPRIGHT = 0.7


def stiff_command(model: RobotModel, position: np.ndarray) -> JointCommand:
    """Hold leg angles `position` (12,) [rad] against the robot's weight."""
    kp, kd = model.scale.of('N m/rad'), model.scale.of('N m s/rad')
    return NO_TORQUE._replace(position=position, kp=_KP * kp, kd=_KD * kd)


def squat_command(model: RobotModel) -> JointCommand:
    """Lead the legs to a squat on feet that are wide apart."""
    pose = similar_pose(model.quadruped, *_SQUAT_LEG)
    pose[::3] += _SQUAT_HIP * np.sign(model.geometry.hip[:, 1])
    gains = _SQUAT_KP * model.scale.of('N m/rad'), _SQUAT_KD * model.scale.of('N m s/rad')
    kp, kd = (np.full(12, gain) for gain in gains)
    return NO_TORQUE._replace(position=pose, kp=kp, kd=kd)


class AfterTrot(State):
    """
    Begins with a robot that rests: one that trots is brought to a halt first.

    Stiff legs at 1 m/s are a somersault, which is what unitree_guide's key 2 does. So is a trot
    whose readings come too slowly: then it squats first, which the motors do alone. A robot that a
    push would tip over steps until it rests, and begins again.
    """

    _squatting = 0.0  # for so long from now [s]

    @property
    def may_be_low(self) -> bool:
        """Whether it squats."""
        return self._squatting > 0.0

    def enter(self, robot: RobotState) -> None:
        """Remember the pose to start from, or halt first."""
        self._rest(robot)
        moves = self._parts.locomotion.gait.is_stepping or self._parts.is_fed_slowly
        self._halting = _HALT_TIME_MAX if moves else 0.0
        self._squatting = 0.0
        if self._parts.walks_on and is_up(self._parts.model, robot):
            self.trust = robot.is_contact.astype(float)
            self._start_steps(robot)

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """One tick of the way to a halt, or of what follows."""
        if self._squatting > 0.0 or (self._halting > 0.0 and self._parts.is_fed_slowly):
            return self._squat(robot, dt)
        if self._halting <= 0.0 and self._may_step and self._tips(robot):
            self._start_steps(robot)
        return self._halt(robot, dt) if self._halting > 0.0 else self._at_rest(robot, dt)

    def _at_rest(self, robot: RobotState, dt: float) -> JointCommand:
        """Next point of the straight line from the measured pose to the stand."""
        self._time += dt
        share = min(self._time / STAND_TIME, 1.0)
        position = (1.0 - share) * self._start + share * self._parts.model.standing_pose
        return stiff_command(self._parts.model, position)

    @property
    def _may_step(self) -> bool:
        """Whether steps may interrupt what it does, to catch a robot that tips."""
        return True

    def _tips(self, robot: RobotState) -> bool:
        stands = self.trust > 0.5
        enough = int(stands.sum()) >= 3 and is_up(self._parts.model, robot)
        return enough and is_to_step(robot, stands, GRAVITY)

    def _start_steps(self, robot: RobotState) -> None:
        """Step in place until feet and base are where they rest well."""
        feet = robot.feet.copy()
        in_air = self.trust <= 0.5
        feet[in_air, 2] = feet[:, 2].min() if in_air.all() else feet[~in_air, 2].mean()
        self._parts.command_filter.reset()
        self._parts.locomotion.reset(robot, feet)
        self._parts.locomotion.gait.start()
        self._halting = _HALT_TIME_MAX

    def _rest(self, robot: RobotState) -> None:
        self._start = robot.joint_position.copy()
        self._time = 0.0
        self.trust = np.ones(4)

    def _halt(self, robot: RobotState, dt: float) -> JointCommand:
        """Trot on toward rest."""
        locomotion, command_filter = self._parts.locomotion, self._parts.command_filter
        command_filter.request(0.0, 0.0, 0.0)
        command = locomotion.step(robot, command_filter.step(dt), dt, is_halting=True)
        self.trust = locomotion.trust
        self._halting -= dt
        if not locomotion.gait.is_stepping or self._halting <= 0.0:
            locomotion.gait.reset()
            self._halting = 0.0
            self._rest(robot)
        return command

    def _squat(self, robot: RobotState, dt: float) -> JointCommand:
        """Go down on feet that are wide apart, and rest there."""
        if self._halting > 0.0:
            self._parts.locomotion.gait.reset()
            self._halting, self._squatting = 0.0, _SQUAT_TIME
        self._squatting -= dt
        self._rest(robot)
        return squat_command(self._parts.model)


class FixedStand(AfterTrot):
    """2.0 s from the measured pose to the stand; entering again starts again."""


def is_up(model: RobotModel, robot: RobotState) -> bool:
    """Whether the legs hold the hips about as high as in the stand."""
    return model.risen(robot.height(model.geometry.foot_radius), robot.base.R) > UP


class OnFeet(AfterTrot):
    """Begins with a robot that stands: one that lies, or has only begun to rise, rises first."""

    def _rest(self, robot: RobotState) -> None:
        super()._rest(robot)
        self._is_risen = is_up(self._parts.model, robot)
        if self._is_risen:
            self._begin_from(robot)

    def _at_rest(self, robot: RobotState, dt: float) -> JointCommand:
        """Rise, then act."""
        if self._is_risen:
            return self._act(robot, dt)
        command = super()._at_rest(robot, dt)
        if self._time >= STAND_TIME:
            super()._rest(robot)
            self._is_risen = True
            self._begin_from(robot)
        return command

    @abstractmethod
    def _begin_from(self, robot: RobotState) -> None:
        """Start from a robot that stands at rest."""

    @abstractmethod
    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """Command of a tick of what this state is for."""


# Roll, pitch, yaw [rad] and height [m] at full stick, on the Go2.
FULL_LEAN = np.array((math.radians(20.0), math.radians(15.0), math.radians(20.0), 0.04))
# How fast they follow the sticks, per second: unitree_guide jumps.
_RATE = np.array((0.7, 0.7, 0.7, 0.08))
# Less is rounding [m].
_REACHED = 1e-6


class FreeStand(OnFeet):
    """
    Inverse kinematics over feet that stay: lx rolls, ly pitches, rx yaws, ry lifts.

    The feet are balls, so their centres roll as the calves lean; led to fixed points instead, they
    turn the robot 10 % further than asked. Where a leg ends, height gives way to the lean.
    """

    def _begin_from(self, robot: RobotState) -> None:
        """Keep the feet as they stand; one that has not risen to the stand yet goes on rising."""
        model, self._angles = self._parts.model, robot.joint_position.copy()
        self._feet = foot_positions(model.geometry, self._angles)
        self._calves = _calf_rotations(self._angles)
        stand = foot_positions(model.geometry, model.standing_pose)
        missing = float((self._feet - stand)[:, 2].mean())
        self._feet[:, 2] -= missing
        self._now = np.array((0.0, 0.0, 0.0, -missing))

    def _act(self, robot: RobotState, dt: float) -> JointCommand:
        """Joint angles for the present lean."""
        sticks = self._parts.sticks.values
        wanted = FULL_LEAN * np.array((sticks.lx, sticks.ly, -sticks.rx, sticks.ry))
        size = np.array((1.0, 1.0, 1.0, self._parts.model.scale.of('m')))
        self._now = approach(self._now, wanted * size, dt * _RATE * size)
        roll, pitch, yaw, lift = self._now.tolist()
        R = rpy_matrix(roll, pitch, yaw)
        feet = (self._feet + self._distance_rolled(R) - np.array((0.0, 0.0, lift))) @ R
        position = all_leg_angles(self._parts.model.geometry, feet)
        limits = self._parts.model.limits
        self._angles = np.clip(position, limits.lower, limits.upper)
        reached = foot_positions(self._parts.model.geometry, self._angles)
        missed = float(((reached - feet) @ R.T)[:, 2].max())
        if missed > _REACHED:
            self._now[3] -= missed
        return stiff_command(self._parts.model, self._angles.copy())

    def _distance_rolled(self, R: np.ndarray) -> np.ndarray:
        """How far the centres of the feet have rolled since entry (4, 3) [m], base at entry."""
        x, y = np.zeros(4), np.zeros(4)
        for leg, (now, before) in enumerate(
            zip(_calf_rotations(self._angles), self._calves, strict=True)
        ):
            x[leg], y[leg], _ = rotation_vector(R @ now @ before.T).tolist()
        radius = self._parts.model.geometry.foot_radius
        return radius * np.column_stack((y, -x, np.zeros(4)))


def _calf_rotations(angles: np.ndarray) -> list[np.ndarray]:
    """Rotations (3, 3) from the calves to the base."""
    return [
        rpy_matrix(hip, 0.0, 0.0) @ rpy_matrix(0.0, thigh + calf, 0.0)
        for hip, thigh, calf in angles.reshape(4, 3).tolist()
    ]


class Trotting(State):
    """Sticks drive: ly forward, lx right, rx turns right; full stick is the speed limit."""

    def enter(self, robot: RobotState) -> None:
        """Stand first; the command starts at zero. One that steps still goes on stepping."""
        self.trust = np.ones(4)
        if self._parts.locomotion.gait.is_stepping:
            self._parts.command_filter.request(0.0, 0.0, 0.0)
            return
        self._parts.command_filter.reset()
        self._parts.locomotion.reset(robot)

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Trot one tick."""
        self._read_command()
        locomotion = self._parts.locomotion
        self._parts.command_filter.grip = locomotion.grip.share
        self._parts.command_filter.most = locomotion.sight.most
        self._parts.command_filter.velocity = robot.planar_velocity
        command = self._parts.command_filter.step(dt, may_go=locomotion.is_up)
        result = locomotion.step(robot, command, dt)
        self.trust = locomotion.trust
        return result

    def _read_command(self) -> None:
        """Ask for what the sticks say; they are latched, so there is no silence."""
        sticks, limits = self._parts.sticks.values, self._parts.command_filter.limits
        forward = limits.forward if sticks.ly > 0.0 else limits.backward
        self._parts.command_filter.request(
            forward * sticks.ly, -limits.lateral * sticks.lx, -limits.yaw * sticks.rx
        )


class MoveBase(Trotting):
    """Velocity commands drive, as long as they keep coming."""

    def _read_command(self) -> None:
        """Commands arrive by `LegController.set_velocity`."""
