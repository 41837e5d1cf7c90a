# SPDX-License-Identifier: Apache-2.0
"""The physics: a robot in a MuJoCo model that is stepped, read and commanded."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from mujoco_sim.errors import SimulationError

FALL_TILT = np.deg2rad(60.0)


class JointStates(NamedTuple):
    """Joints in the order of `World.joint_names`, each array of shape (n,)."""

    position: np.ndarray  # [rad]
    velocity: np.ndarray  # [rad/s]
    effort: np.ndarray  # [N m], what the motor applied; 0 for a joint without one


class JointCommand(NamedTuple):
    """
    Motors in the order of `World.motor_names`, each array of shape (m,).

    The motor applies `effort + kp (position - q) + kd (velocity - v)` [N m], clipped to its limit,
    at every physics step.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    kp: np.ndarray
    kd: np.ndarray


class BaseState(NamedTuple):
    """The robot's root frame as physics knows it; without sensor noise."""

    position: np.ndarray  # p_world_base [m], shape (3,)
    orientation: np.ndarray  # quaternion w, x, y, z of R_world_base, shape (4,)
    linear_velocity: np.ndarray  # in the world frame [m/s], shape (3,)
    angular_velocity: np.ndarray  # in the base frame [rad/s], shape (3,)

    @property
    def rpy(self) -> np.ndarray:
        """Roll, pitch, yaw [rad], shape (3,); R = Rz(yaw) Ry(pitch) Rx(roll)."""
        w, x, y, z = self.orientation
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.array([roll, pitch, yaw])

    @property
    def tilt(self) -> float:
        """Angle between the base's z axis and the world's [rad]."""
        _, x, y, _ = self.orientation
        return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    @property
    def planar_velocity(self) -> np.ndarray:
        """Velocity ahead and to the left [m/s] by yaw, and turn about world z [rad/s], (3,)."""
        roll, pitch, yaw = self.rpy
        vx, vy, _ = self.linear_velocity
        cos, sin = np.cos(yaw), np.sin(yaw)
        # The third row of Rz(yaw) Ry(pitch) Rx(roll), which yaw does not change.
        third_row = np.array(
            [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
        )
        turn = third_row @ self.angular_velocity
        return np.array([cos * vx + sin * vy, cos * vy - sin * vx, turn])


class World:
    """
    One robot in one compiled model.

    Keeps MuJoCo's state, the command in force, the push in force and `tick`, the number of physics
    steps so far. The same seed and the same calls give the same bits.
    """

    def __init__(self, spec: mujoco.MjSpec, root: str, seed: int = 0) -> None:
        """
        Compile the specification; `root` is the body on the free joint.

        Raises:
            SimulationError: what the compiler says, in one line.
        """
        try:
            self.model = spec.compile()
        except ValueError as error:
            raise SimulationError(f'MuJoCo: {" ".join(str(error).split())}') from None
        self.data = mujoco.MjData(self.model)
        self.root = self.model.body(root).id
        self.seed = seed
        self.tick = 0
        self.rejected_commands = 0
        joints = [self.model.joint(i) for i in range(self.model.njnt)]
        hinges = [joint for joint in joints if joint.type[0] != mujoco.mjtJoint.mjJNT_FREE]
        self.joint_names = tuple(joint.name for joint in hinges)
        self.motor_names = tuple(self.model.actuator(i).name for i in range(self.model.nu))
        self._position_address = np.array([joint.qposadr[0] for joint in hinges], dtype=int)
        self._velocity_address = np.array([joint.dofadr[0] for joint in hinges], dtype=int)
        self._motor_joint = np.array(
            [self.joint_names.index(name) for name in self.motor_names], dtype=int
        )
        self.reset()

    @property
    def time_step(self) -> float:
        """Duration of one physics step [s]."""
        return float(self.model.opt.timestep)

    @property
    def time(self) -> float:
        """Simulated time since construction [s]; `reset` does not turn it back."""
        return self.tick * self.time_step

    def reset(self) -> None:
        """Put the robot back to where it began, at rest, random numbers included; time goes on."""
        mujoco.mj_resetData(self.model, self.data)
        self.random = np.random.default_rng(self.seed)
        self._push_until = -1
        self.brake(damping=0.0)
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int = 1) -> None:
        """Advance by `count` physics steps with the command in force."""
        while count > 0:
            run = count
            if self.tick < self._push_until:
                run = min(count, self._push_until - self.tick)
            mujoco.mj_step(self.model, self.data, run)
            self.tick += run
            count -= run
            if self.tick == self._push_until:
                self.data.xfrc_applied[self.root] = 0.0

    def joints(self) -> JointStates:
        """Return the joints now."""
        effort = np.zeros(len(self.joint_names))
        effort[self._motor_joint] = self.data.actuator_force
        return JointStates(
            self.data.qpos[self._position_address],
            self.data.qvel[self._velocity_address],
            effort,
        )

    def base(self) -> BaseState:
        """Return the root frame now."""
        return BaseState(
            self.data.qpos[0:3].copy(),
            self.data.qpos[3:7].copy(),
            self.data.qvel[0:3].copy(),
            self.data.qvel[3:6].copy(),
        )

    def apply(self, command: JointCommand) -> bool:
        """
        Put a command in force until the next one; return whether it was taken.

        A command that is not finite or of the wrong length is refused and the motors brake.
        """
        stacked = [np.asarray(part, dtype=float) for part in command]
        wanted = (len(self.motor_names),)
        if any(part.shape != wanted or not np.isfinite(part).all() for part in stacked):
            self.rejected_commands += 1
            self.brake()
            return False
        position, velocity, effort, kp, kd = stacked
        self.model.actuator_biasprm[:, 1] = -kp
        self.model.actuator_biasprm[:, 2] = -kd
        self.data.ctrl[:] = effort + kp * position + kd * velocity
        return True

    def brake(self, damping: float | None = None) -> None:
        """Let the motors only resist motion, with `damping` [N m s/rad], by default as before."""
        if damping is not None:
            self.model.actuator_biasprm[:, 2] = -damping
        self.model.actuator_biasprm[:, 1] = 0.0
        self.data.ctrl[:] = 0.0

    def push(self, force: Sequence[float], duration: float) -> None:
        """Apply a world-frame force [N], shape (3,), at the root's centre of mass, so long [s]."""
        self.data.xfrc_applied[self.root, :3] = force
        self._push_until = self.tick + max(1, round(duration / self.time_step))

    def contact_forces(self, bodies: Sequence[int]) -> np.ndarray:
        """Return the normal force on each body [N], shape (len(bodies),)."""
        forces = np.zeros(len(bodies))
        wrench = np.zeros(6)
        for index in range(self.data.ncon):
            touching = self.model.geom_bodyid[self.data.contact.geom[index]]
            for place, body in enumerate(bodies):
                if body in touching:
                    mujoco.mj_contactForce(self.model, self.data, index, wrench)
                    forces[place] += wrench[0]
        return forces
