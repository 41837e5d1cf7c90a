# SPDX-License-Identifier: Apache-2.0
"""The robot as the controller knows it: built from its URDF by Pinocchio, nothing typed in."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
import pinocchio as pin
from robot_description.description import Description
from robot_description.morphology.quadruped import (
    FOLDED,
    GO2_SPEED,
    imu_position,
    Quadruped,
    REFLECTED_INERTIA,
    scale_of,
    similar_pose,
)
from robot_description.pinocchio_model import to_pinocchio
from robot_description.robot import Robot
from wasd_core.errors import DescriptionError, RobotModelError
from wasd_core.robot_io import GRAVITY, JointCommand, JointStates, Reading
from wasd_core.streams import visible

from quadruped_sim.algebra import flatten
from quadruped_sim.dynamics import blank_links, Bodies
from quadruped_sim.leg_kinematics import foot_positions, LEFT, leg_motion, LegGeometry

# The closed form may miss the feet by so much per leg length: descriptions round right angles.
GEOMETRY_TOLERANCE = 2e-3
# Three times the torque of the Go2's knees [N m]: descriptions without a limit say 1000.
EFFORT_MAX = 107.0
# From the middle of the Go2 to a foot under its hip, ahead and to the side, a hair more [m].
GO2_HIPS = np.array((0.1936, 0.1422))
# A leg whose knee points forward walks ahead as its mirror image walks back.
FORWARD_KNEES = 0.75
# Thigh and calf of the Go2 [rad]: unitree_guide's stand, and about what they are in trot.
STANDING = (0.67, -1.3)
WALKING = (0.8, -1.6)
# Hip, thigh and calf of a left leg in the middle of all that is free [rad]: from anywhere a leg
# comes home around the outside of the trunk.
MIDDLE = (1.3, 1.0, -0.3)
# The least and the most that it does with them [rad].
USED = ((-1.0, -1.5, -2.8), (1.0, 3.5, -0.3))


# A command of leg angles by which no motor pushes; others are made of it.
NO_TORQUE = JointCommand(*(np.zeros(12) for _ in JointCommand._fields))
for _part in NO_TORQUE:
    _part.flags.writeable = False  # every damped and passive command shares them


@dataclass(frozen=True)
class JointLimits:
    """Limits of the leg angles, each (12,): [rad], [rad], [rad/s], [N m]."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


class RobotModel:
    """
    Mass, inertia, leg geometry and dynamics of a quadruped, in leg angles leg by leg.

    Leg angles are those of `robot_description.morphology`: zero when a leg hangs straight down.
    Keeps Pinocchio's model and data and the way from leg angles to its joint positions; `rigid`
    are its `Bodies` and the `Links` of a tick, flat, by which the dynamics are found. `scale`
    compares the robot with the Go2; the rotors' inertia reflected through the gears, which a
    URDF leaves out, is taken to grow as it does. `friction` is the feet's, infinite if not given.

    Raises:
        RobotModelError: the description is not a quadruped that can be walked; says which file.
    """

    def __init__(self, description: Description) -> None:
        try:
            self._read(description)
        except (DescriptionError, RobotModelError) as error:
            raise RobotModelError(f'{description.path}: {error}') from None

    def _read(self, description: Description) -> None:
        robot = description.robot
        self.quadruped = description.quadruped
        _check_feet(robot, self.quadruped)
        self.scale = scale_of(self.quadruped)
        self.limits = _limits(self.quadruped, EFFORT_MAX * self.scale.of('N m'))
        self.geometry = _geometry(self.quadruped)
        self.imu_offset = imu_position(robot)
        self.friction = min(robot.friction.get(foot, math.inf) for foot in self.quadruped.feet)
        self.folded_pose = similar_pose(self.quadruped, *FOLDED)
        self.standing_pose = similar_pose(self.quadruped, *STANDING)
        self.walking_pose = similar_pose(self.quadruped, *WALKING)
        # The middle of the hips in the base (3,), and how high it is over the ground in the stand,
        # wherever the base is [m].
        self.hips = self.geometry.hip.mean(axis=0)
        feet = foot_positions(self.geometry, self.standing_pose)
        self._standing_height = self.geometry.foot_radius + float(self.hips[2] - feet[:, 2].mean())
        self._build(description)
        self.mass = float(pin.computeTotalMass(self._model))
        self.weight = self.mass * GRAVITY
        self._check_geometry()

    def _build(self, description: Description) -> None:
        """Build Pinocchio's model, and note how its joints are ordered and turned."""
        self._model = to_pinocchio(description, for_control=True, held=self.quadruped.held)
        if self._model.nv != 18:
            raise RobotModelError(f'12 moving joints wanted, got {self._model.nv - 6}')
        self._data = self._model.createData()
        self._ids = [self._model.getJointId(name) for name in self.quadruped.joint_names]
        joints = [self._model.joints[index] for index in self._ids]
        self._to_q = np.array([joint.idx_q for joint in joints])
        self._sign, self._zero = self.quadruped.sign, self.quadruped.zero
        self._is_plain = self.quadruped.is_plain
        self._neutral = pin.neutral(self._model)
        self.rigid = flatten(self._find_bodies()), flatten(blank_links())

    def _find_bodies(self) -> Bodies:
        """Return what Pinocchio knows of the bodies, for leg angles."""
        model, ids = self._model, self._ids
        pin.computeJointJacobians(model, self._data, self._neutral)
        columns = [
            pin.getJointJacobian(model, self._data, index, pin.ReferenceFrame.LOCAL)
            for index in ids
        ]
        rates = [model.joints[index].idx_v for index in ids]
        axes = [column[3:, rate] for column, rate in zip(columns, rates, strict=True)]
        bodies = [model.inertias[index] for index in (1, *ids)]
        return Bodies(
            np.array([model.jointPlacements[index].rotation for index in ids]),
            np.array([model.jointPlacements[index].translation for index in ids]),
            self._sign[:, None] * np.array(axes),
            self._zero.copy(),
            np.full(12, REFLECTED_INERTIA * self.scale.of('kg m^2')),
            np.array([joint.damping for joint in self.quadruped.joints]),
            np.array([joint.friction for joint in self.quadruped.joints]),
            np.array([body.mass for body in bodies]),
            np.array([body.lever for body in bodies]),
            np.array([body.inertia for body in bodies]),
        )

    def _check_geometry(self) -> None:
        """Compare the closed form with Pinocchio in a bent pose."""
        angles = np.tile((0.3, 0.8, -1.6), 4) + 0.01 * np.arange(12)
        difference = foot_positions(self.geometry, angles) - self.foot_positions(angles)
        worst = float(np.abs(difference).max())
        if not worst < GEOMETRY_TOLERANCE * float(self.geometry.thigh.max()):
            raise RobotModelError(
                'the legs must turn about x at the hip and about y at thigh and calf; the closed '
                f'form misses the feet by {worst:.4f} m'
            )

    @property
    def agility(self) -> float:
        """How fast it may walk, for its size, as a share of the Go2's; at most 1."""
        knees = 1.0 if (self.geometry.bend > 0.0).all() else FORWARD_KNEES
        return knees * self.motor_speed

    @property
    def motor_speed(self) -> float:
        """No-load speed of its slowest thigh or knee, for its size, as a share of the Go2's."""
        speed = float(self.limits.velocity[self._slowest])
        return min(1.0, speed / (GO2_SPEED * self.scale.of('rad/s')))

    @property
    def _slowest(self) -> int:
        """The thigh or calf joint whose motor is the slowest."""
        speeds = self.limits.velocity.copy()
        speeds[::3] = math.inf
        return int(np.argmin(speeds))

    @property
    def turning(self) -> float:
        """How fast it may turn, for its size: far from the middle, feet have far to go."""
        farthest = float(np.linalg.norm(self._out, axis=1).max())
        return min(1.0, float(np.linalg.norm(GO2_HIPS)) * self.scale.of('m') / farthest)

    @property
    def slimness(self) -> tuple[float, float]:
        """Length and width between a Go2's feet, for its size, over its own; each at most 1."""
        shares = GO2_HIPS * self.scale.of('m') / np.abs(self._out).max(axis=0)
        length, width = np.minimum(shares, 1.0).tolist()
        return length, width

    @property
    def _out(self) -> np.ndarray:
        """Where feet are under the hips (4, 2), from the middle of the robot [m]."""
        hips = self.geometry.hip[:, :2].copy()
        hips[:, 1] += self.geometry.offset
        return np.asarray(hips - hips.mean(axis=0))

    def risen(self, height: float, R: np.ndarray) -> float:
        """
        Return how high the hips are over the ground, as a share of the stand.

        `height` [m] is that of the base, `R` (3, 3) turns its axes to the world's.
        """
        return (height + float(R[2] @ self.hips)) / self._standing_height

    def overloaded(self, legs: int) -> dict[str, float]:
        """
        Joints too weak to carry the weight on so many legs at once; the torque they need [N m].

        On 4 it stands, on 2 it trots.
        """
        pose = self.standing_pose if legs == 4 else self.walking_pose
        motion = leg_motion(self.geometry, pose, np.zeros(12))
        torque = self.weight / legs * np.abs(motion.jacobian[:, 2]).reshape(12)
        names = self.quadruped.joint_names
        return {names[i]: float(torque[i]) for i in np.flatnonzero(torque > self.limits.effort)}

    def motor_notes(self, forward: float, usual: float) -> tuple[str, ...]:
        """
        Return what its motors cannot do, with numbers.

        `forward` [m/s] is full stick, `usual` what it would be with motors as fast as a Go2's.
        """
        notes, names = [], self.quadruped.joint_names
        if self.motor_speed < 1.0 and forward < usual:
            speed, name = self.limits.velocity[self._slowest], names[self._slowest]
            notes.append(
                f'motors of {speed:.3g} rad/s (joint {visible(name)}) allow {forward:.2g} m/s; '
                'full stick lowered'
            )
        for legs, deed in ((4, 'stand'), (2, 'trot')):
            weak = self.overloaded(legs)
            if weak:
                efforts = dict(zip(names, self.limits.effort.tolist(), strict=True))
                worst = max(weak, key=lambda name: weak[name] / efforts[name])
                more = f' (and {len(weak) - 1} more joints)' if len(weak) > 1 else ''
                notes.append(
                    f'motors too weak to {deed}: {visible(worst)} needs {weak[worst]:.3g} N m, '
                    f'has {efforts[worst]:.3g} N m{more}'
                )
                break
        return tuple(notes)

    def foot_positions(self, angles: np.ndarray) -> np.ndarray:
        """Foot centres in base axes [m], shape (4, 3), by Pinocchio."""
        calves = self._ids[2::3]
        pin.forwardKinematics(self._model, self._data, self._positions(self._zero))
        centres = [leg.foot_centre for leg in self.quadruped.legs]
        local = [
            self._data.oMi[calf].actInv(centre)
            for calf, centre in zip(calves, centres, strict=True)
        ]
        pin.forwardKinematics(self._model, self._data, self._positions(angles))
        return np.array(
            [self._data.oMi[calf].act(foot) for calf, foot in zip(calves, local, strict=True)]
        )

    def inertia_about_com(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inertia (3, 3) [kg m^2] about the CoM in this pose, and the CoM (3,) in base [m]."""
        q = self._positions(angles)
        pin.ccrba(self._model, self._data, q, np.zeros(self._model.nv))
        return np.array(self._data.Ig.inertia), np.array(self._data.com[0])

    def _positions(self, angles: np.ndarray) -> np.ndarray:
        """Pinocchio's configuration with the base at the origin and the legs at `angles`."""
        q: np.ndarray = self._neutral.copy()
        q[self._to_q] = angles if self._is_plain else self._sign * (angles - self._zero)
        return q


def _check_feet(robot: Robot, quadruped: Quadruped) -> None:
    """Check that each lower leg has something that collides, to stand on."""
    for leg in quadruped.legs:
        carrier = robot.carriers[leg.foot]
        if not any(robot.links[k].collisions for k, v in robot.carriers.items() if v == carrier):
            raise RobotModelError(
                f'nothing of foot {leg.foot!r} collides: it would sink into the floor; '
                'give it a <collision> with a <sphere>'
            )


def _limits(quadruped: Quadruped, effort_max: float) -> JointLimits:
    """Return the limits of legs whose joints all have motors, of at most `effort_max` [N m]."""
    weak = [joint.name for joint in quadruped.joints if not joint.effort > 0.0]
    if weak:
        raise RobotModelError(
            f'no motor on {", ".join(weak)}: give the joint a <limit effort="..." velocity="..."/>'
        )
    return JointLimits(
        lower=np.concatenate([leg.lower for leg in quadruped.legs]),
        upper=np.concatenate([leg.upper for leg in quadruped.legs]),
        velocity=np.array([joint.velocity or math.inf for joint in quadruped.joints]),
        effort=np.array([min(joint.effort, effort_max) for joint in quadruped.joints]),
    )


def _geometry(quadruped: Quadruped) -> LegGeometry:
    legs = quadruped.legs
    return LegGeometry(
        hip=np.array([leg.hip for leg in legs]),
        offset=np.array([leg.offset for leg in legs]),
        drop=np.array([leg.drop for leg in legs]),
        thigh=np.array([leg.thigh for leg in legs]),
        calf=np.array([leg.calf for leg in legs]),
        foot_radius=float(np.median([leg.foot_radius for leg in legs])),
        bend=np.array([leg.bend for leg in legs]),
    )


class _Turns:
    """
    Which whole turns of the leg angles (12,) of joints that turn on are left out.

    Those whose stops are beyond a turn have the nearest from which all that legs do is in reach.
    """

    def __init__(self, quadruped: Quadruped) -> None:
        legs = quadruped.legs
        signs = np.array(
            [(left, leg.bend, leg.bend) for left, leg in zip(LEFT, legs, strict=True)]
        )
        self._middle = (signs * MIDDLE).ravel()
        used = np.sort([signs * end for end in USED], axis=0).reshape(2, 12)
        lower = np.concatenate([leg.lower for leg in legs])
        upper = np.concatenate([leg.upper for leg in legs])
        is_endless = upper - lower > math.tau
        least, most = (lower - used[0]) / math.tau, (upper - used[1]) / math.tau
        self._least = np.where(is_endless, np.minimum(np.ceil(least), 0.0), 0.0)
        self._most = np.where(is_endless, np.maximum(np.floor(most), 0.0), 0.0)
        self.has_any = bool((self._most > self._least).any())

    def of(self, angles: np.ndarray) -> np.ndarray:
        """Return how much of angles (12,) [rad] is whole turns."""
        turns = np.round((angles - self._middle) / math.tau)
        return math.tau * np.clip(turns, self._least, self._most)


class JointMap:
    """
    Between joints as a description has them and leg angles as the controller has them.

    `joint_names` are the joints of a reading and `motor_names` those of a command, in their
    order; both hold the twelve leg joints. Other motors get no command. An angle of a joint that
    turns round and round is known but for whole turns: a command goes to the nearest.
    """

    def __init__(
        self, quadruped: Quadruped, joint_names: Sequence[str], motor_names: Sequence[str]
    ) -> None:
        names = quadruped.joint_names
        self._joints = np.array([joint_names.index(name) for name in names])
        others = len(names)  # where a command has a zero added
        self._motors = np.array(
            [names.index(name) if name in names else others for name in motor_names]
        )
        self._has_others = others in self._motors
        own = np.arange(others)
        orders = self._joints, self._motors
        is_in_order = all(np.array_equal(own, each) for each in orders)
        self._turns, self._left_out = _Turns(quadruped), np.zeros(others)
        is_alike = quadruped.is_plain and not self._turns.has_any
        self._is_same = is_alike and is_in_order and len(joint_names) == others
        self._sign, self._zero = quadruped.sign, quadruped.zero
        self._is_plain = quadruped.is_plain

    def reading(self, reading: Reading) -> Reading:
        """Return a reading of joints as one of leg angles."""
        if self._is_same:
            return reading
        position, velocity, effort = (part[self._joints] for part in reading.joints)
        if not self._is_plain:
            position = self._sign * position + self._zero
            velocity, effort = self._sign * velocity, self._sign * effort
        if self._turns.has_any:
            self._left_out = self._turns.of(position)
            position = position - self._left_out
        return Reading(JointStates(position, velocity, effort), reading.imu)

    def command(self, command: JointCommand) -> JointCommand:
        """Return a command of leg angles as one of motors."""
        if self._is_same:
            return command
        position, velocity, effort, kp, kd = command
        if self._turns.has_any:
            position = position + self._left_out
        if not self._is_plain:
            position = self._sign * (position - self._zero)
            velocity, effort = self._sign * velocity, self._sign * effort
        parts = [position, velocity, effort, kp, kd]
        if self._has_others:
            parts = [np.append(part, 0.0) for part in parts]
        return JointCommand(*(part[self._motors] for part in parts))
