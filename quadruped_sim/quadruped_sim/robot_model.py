# SPDX-License-Identifier: Apache-2.0
"""The robot as the controller knows it: built from its URDF by Pinocchio, nothing typed in."""

from dataclasses import dataclass
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

from quadruped_sim.exceptions import RobotModelError
from quadruped_sim.leg_kinematics import foot_positions
from quadruped_sim.leg_kinematics import LegGeometry
from quadruped_sim.legs import FOOT_NAMES
from quadruped_sim.legs import JOINT_NAMES
from quadruped_sim.legs import LEGS


@dataclass(frozen=True)
class JointLimits:
    """Limits of the joints, each (12,): [rad], [rad], [rad/s], [N m]."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass
class Dynamics:
    """
    Terms of M dv + h = tau + J' f, with v = (base linear, base angular, joints), base axes.

    `mass` (18, 18); `bias` (18,) is h at the present velocity, gravity included; `momentum` (12,)
    is the joint part of M v and `momentum_drift` (12,) that of C' v - g.
    """

    mass: np.ndarray
    bias: np.ndarray
    momentum: np.ndarray
    momentum_drift: np.ndarray


class RobotModel:
    """
    Mass, inertia, leg geometry and dynamics of a robot whose URDF has Unitree's joint names.

    Keeps Pinocchio's model and data and the permutation between its joint order and `LEGS`.
    `armature` [kg m^2] is the rotors' inertia reflected through the gears, which a
    URDF leaves out.
    """

    def __init__(self, urdf: str, armature: float = 0.01) -> None:
        urdf = _without_world(urdf)
        try:
            self._model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
        except (ValueError, RuntimeError) as error:
            raise RobotModelError(f'the description cannot be read: {error}') from error
        self._check_names()
        self._data = self._model.createData()
        joints = [self._model.joints[self._model.getJointId(name)] for name in JOINT_NAMES]
        self._to_q = np.array([joint.idx_q for joint in joints])
        self._to_v = np.array([joint.idx_v for joint in joints])
        armatures = np.zeros(self._model.nv)
        armatures[6:] = armature
        self._model.armature = armatures
        self._order = np.concatenate((np.arange(6), self._to_v))
        self._grid = np.ix_(self._order, self._order)
        self._is_ordered = bool((self._order == np.arange(18)).all())
        self._q = pin.neutral(self._model)
        self._v = np.zeros(self._model.nv)

        self.mass = float(pin.computeTotalMass(self._model))
        self.weight = self.mass * 9.81
        self.limits = JointLimits(
            lower=self._model.lowerPositionLimit[self._to_q],
            upper=self._model.upperPositionLimit[self._to_q],
            velocity=self._model.velocityLimit[self._to_v],
            effort=self._model.effortLimit[self._to_v],
        )
        self.geometry = self._leg_geometry(_foot_radius(urdf))
        self._check_geometry()
        self.imu_offset = self._frame_offset('imu')

    def _check_names(self) -> None:
        missing = [name for name in JOINT_NAMES if not self._model.existJointName(name)]
        missing += [name for name in FOOT_NAMES if not self._model.existFrame(name)]
        if missing:
            found = ', '.join(list(self._model.names)[2:])
            raise RobotModelError(f'missing {", ".join(missing)}; joints found: {found}')
        if self._model.nv != 18:
            raise RobotModelError(f'12 moving joints wanted, got {self._model.nv - 6}')

    def _leg_geometry(self, foot_radius: float) -> LegGeometry:
        """Read the dimensions off the model at zero joint angles, where the legs hang straight."""
        pin.framesForwardKinematics(self._model, self._data, pin.neutral(self._model))
        place = self._data.oMi
        hips, thighs, calves = (
            np.array([place[self._joint(leg, part)].translation for leg in LEGS])
            for part in ('hip', 'thigh', 'calf')
        )
        feet = self._feet_at_neutral()
        hips[:, 0] = thighs[:, 0]
        return LegGeometry(
            hip=hips,
            offset=(thighs - hips)[:, 1].copy(),
            thigh=float((thighs - calves)[0, 2]),
            calf=float((calves - feet)[0, 2]),
            foot_radius=foot_radius,
        )

    def _joint(self, leg: str, part: str) -> int:
        return int(self._model.getJointId(f'{leg}_{part}_joint'))

    def _feet_at_neutral(self) -> np.ndarray:
        return np.array(
            [self._data.oMf[self._model.getFrameId(name)].translation for name in FOOT_NAMES]
        )

    def _frame_offset(self, name: str) -> np.ndarray:
        """Place (3,) [m] of a frame fixed to the base; zero when there is none."""
        if not self._model.existFrame(name):
            return np.zeros(3)
        frame = self._model.frames[self._model.getFrameId(name)]
        return np.array(frame.placement.translation)

    def _check_geometry(self) -> None:
        """Compare the closed form with Pinocchio in a bent pose."""
        angles = np.tile((0.3, 0.8, -1.6), 4) + 0.01 * np.arange(12)
        difference = foot_positions(self.geometry, angles) - self.foot_positions(angles)
        worst = float(np.abs(difference).max())
        if not worst < 1e-6:
            raise RobotModelError(
                'the legs must turn about x at the hip and about y at thigh and calf, with equal '
                f'lengths; the closed form misses the feet by {worst:.4f} m'
            )

    def foot_positions(self, angles: np.ndarray) -> np.ndarray:
        """Foot centres in base axes [m], shape (4, 3), by Pinocchio."""
        q = pin.neutral(self._model)
        q[self._to_q] = angles
        pin.framesForwardKinematics(self._model, self._data, q)
        return self._feet_at_neutral()

    def inertia_about_com(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inertia (3, 3) [kg m^2] about the CoM in this pose, and the CoM (3,) in base [m]."""
        q = pin.neutral(self._model)
        q[self._to_q] = angles
        pin.ccrba(self._model, self._data, q, np.zeros(self._model.nv))
        return np.array(self._data.Ig.inertia), np.array(self._data.com[0])

    def centre_of_mass(self, angles: np.ndarray) -> np.ndarray:
        """Centre of mass in base axes (3,) [m]."""
        q = self._q.copy()
        q[:7] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        q[self._to_q] = angles
        return np.array(pin.centerOfMass(self._model, self._data, q))

    def dynamics(
        self,
        orientation: np.ndarray,
        velocity: np.ndarray,
        angular_velocity: np.ndarray,
        angles: np.ndarray,
        rates: np.ndarray,
    ) -> Dynamics:
        """
        Equations of motion at a state.

        `orientation` is (w, x, y, z), `velocity` [m/s] and `angular_velocity` [rad/s] are those of
        the base in base axes.
        """
        model, data, q, v = self._model, self._data, self._q, self._v
        q[3:6] = orientation[1:]
        q[6] = orientation[0]
        q[self._to_q] = angles
        v[0:3] = velocity
        v[3:6] = angular_velocity
        v[self._to_v] = rates
        pin.computeAllTerms(model, data, q, v)
        M = data.M
        coriolis = pin.computeCoriolisMatrix(model, data, q, v)
        momentum = (M @ v)[self._to_v]
        drift = (v @ coriolis - data.g)[self._to_v]
        if self._is_ordered:
            return Dynamics(M, data.nle, momentum, drift)
        return Dynamics(M[self._grid], data.nle[self._order], momentum, drift)


def _without_world(urdf: str) -> str:
    """
    Drop a root link called `world` that holds the robot up (`DEBUG:=true`).

    Raises:
        RobotModelError: the text is not XML.
    """
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise RobotModelError(f'the description is not XML: {error}') from error
    for joint in root.findall('joint'):
        parent = joint.find('parent')
        if parent is not None and parent.get('link') == 'world':
            root.remove(joint)
            for link in root.findall('link'):
                if link.get('name') == 'world':
                    root.remove(link)
            return ElementTree.tostring(root, encoding='unicode')
    return urdf


def _foot_radius(urdf: str) -> float:
    """Radius [m] of the sphere that is FL_foot's collision; 0.02 when it is no sphere."""
    for link in ElementTree.fromstring(urdf).findall('link'):
        if link.get('name') == FOOT_NAMES[0]:
            sphere = link.find('collision/geometry/sphere')
            if sphere is not None:
                return float(sphere.get('radius', '0.02'))
    return 0.02
