# SPDX-License-Identifier: Apache-2.0
"""The physics: a robot in a MuJoCo model that is stepped, read and commanded."""

from collections import deque
from collections.abc import Sequence
import math
from typing import NamedTuple

import mujoco
import numpy as np

from mujoco_sim.errors import SimulationError
from mujoco_sim.motors import TorqueSpeedCurve
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.sensors import ImuReading
from mujoco_sim.sensors import JointStates
from mujoco_sim.sensors import NoisySensors
from mujoco_sim.sensors import Reading

FALL_TILT = np.deg2rad(60.0)
# Damping of motors that brake without having been commanded any [N m s/rad]: a Go2 sinks down.
BRAKE_DAMPING = 3.0
# ... but at most this share of what stops a joint within one physics step: motor torques are
# integrated explicitly, which diverges beyond 2 and rings beyond 1.
STABLE_SHARE = 0.5


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
        # In plain numbers: numpy takes ten times as long for one of these.
        w, x, y, z = self.orientation.tolist()
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.array([roll, pitch, yaw])

    @property
    def tilt(self) -> float:
        """Angle between the base's z axis and the world's [rad]."""
        _, x, y, _ = self.orientation.tolist()
        return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))

    @property
    def planar_velocity(self) -> np.ndarray:
        """Velocity ahead and to the left [m/s] by yaw, and turn about world z [rad/s], (3,)."""
        roll, pitch, yaw = self.rpy.tolist()
        vx, vy, _ = self.linear_velocity.tolist()
        p, q, r = self.angular_velocity.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        # The third row of Rz(yaw) Ry(pitch) Rx(roll), which yaw does not change.
        turn = math.cos(pitch) * (math.sin(roll) * q + math.cos(roll) * r) - math.sin(pitch) * p
        return np.array([cos * vx + sin * vy, cos * vy - sin * vx, turn])


class World:
    """
    One robot in one compiled model.

    Keeps MuJoCo's state, the command and pushes in force and `tick`, the number of physics steps
    so far. Before any command motors are limp. Same seed and same calls give the same bits.
    """

    def __init__(
        self, spec: mujoco.MjSpec, root: str, seed: int = 0, setup: RobotSetup | None = None
    ) -> None:
        """
        Compile the specification; `root` is the body on the free joint, or held in place.

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
        self.setup = setup or RobotSetup()
        self.tick = 0
        self.rejected_commands = 0
        self.is_kinematic = False  # then it moves by `kinematic.place` only
        joints = [self.model.joint(i) for i in range(self.model.njnt)]
        hinges = [joint for joint in joints if joint.type[0] != mujoco.mjtJoint.mjJNT_FREE]
        self._floats = bool(joints) and joints[0].type[0] == mujoco.mjtJoint.mjJNT_FREE
        self.joint_names = tuple(joint.name for joint in hinges)
        self.motor_names = tuple(self.model.actuator(i).name for i in range(self.model.nu))
        self.time_step = float(self.model.opt.timestep)
        self._position_address = np.array([joint.qposadr[0] for joint in hinges], dtype=int)
        self._velocity_address = np.array([joint.dofadr[0] for joint in hinges], dtype=int)
        self._motor_joint = np.array(
            [self.joint_names.index(name) for name in self.motor_names], dtype=int
        )
        self._motor_velocity = self._velocity_address[self._motor_joint]
        self._link_of_geom = [
            self.model.geom(i).name.partition('/')[0] for i in range(self.model.ngeom)
        ]
        self.has_imu = self.model.nsensor >= 2
        self._command_delay = round(self.setup.command_delay / self.time_step)
        self._curve = self._torque_speed_curve()
        self._peak_effort = np.zeros(len(self.motor_names))
        # Of a wheel in the air, the worst case: on the ground it has the robot to move, too.
        stopping = 1.0 / (self.model.dof_invweight0[self._motor_velocity] * self.time_step)
        self._brake_damping = np.minimum(BRAKE_DAMPING, STABLE_SHARE * stopping)
        self.reset()

    @property
    def time(self) -> float:
        """Simulated time since construction [s]; `reset` does not turn it back."""
        return self.tick * self.time_step

    def reset(self) -> None:
        """Put the robot back to where it began, at rest, random numbers included; time goes on."""
        mujoco.mj_resetData(self.model, self.data)
        for name, position in self.setup.joint_positions.items():
            self.data.joint(name).qpos[0] = position
        if self._floats:
            self.data.qpos[2] = self.setup.height
        noise = self.setup.noise
        self._sensors = NoisySensors(noise, self.seed) if noise is not None else None
        self._reading: tuple[int, Reading] | None = None
        self._pushes: list[tuple[int, np.ndarray]] = []
        self._pending: deque[tuple[int, np.ndarray]] = deque()
        self._put_in_force(np.zeros((5, len(self.motor_names))))
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int = 1) -> None:
        """Advance by `count` physics steps; commands and pushes begin and end within them."""
        last = self.tick + count
        while self.tick < last:
            until = last
            if self._pending:
                if self._pending[0][0] <= self.tick:
                    self._put_in_force(self._pending.popleft()[1])
                    continue
                until = min(until, self._pending[0][0])
            if self._pushes:
                until = min(until, *(end for end, _ in self._pushes))
            self._advance(until - self.tick)
            if self._pushes:
                self._pushes = [push for push in self._pushes if push[0] > self.tick]
                self._sum_pushes()

    def read(self) -> Reading:
        """Return what the sensors measure now; asked twice in one instant, they say the same."""
        if self._reading is None or self._reading[0] != self.tick:
            true = Reading(self.joints(), self._true_imu() if self.has_imu else None)
            reading = true if self._sensors is None else self._sensors.measure(true)
            self._reading = (self.tick, reading)
        return self._reading[1]

    def joints(self) -> JointStates:
        """Return the joints without noise; the efforts are those in the last physics step."""
        effort = np.zeros(len(self.joint_names))
        effort[self._motor_joint] = self.data.actuator_force
        return JointStates(
            self.data.qpos[self._position_address],
            self.data.qvel[self._velocity_address],
            effort,
        )

    def take_peak_effort(self) -> np.ndarray:
        """Return the largest effort of each motor since the last call [N m], shape (m,)."""
        peak: np.ndarray = np.maximum(self._peak_effort, np.abs(self.data.actuator_force))
        self._peak_effort = np.zeros(len(self.motor_names))
        return peak

    def base(self) -> BaseState:
        """Return the root frame as it is, without noise."""
        if not self._floats:
            pose = self.data.xpos[self.root].copy(), self.data.xquat[self.root].copy()
            return BaseState(*pose, np.zeros(3), np.zeros(3))
        return BaseState(
            self.data.qpos[0:3].copy(),
            self.data.qpos[3:7].copy(),
            self.data.qvel[0:3].copy(),
            self.data.qvel[3:6].copy(),
        )

    def apply(self, command: JointCommand) -> bool:
        """
        Put a command in force, after the setup's delay and until the next; return if it was taken.

        A command that is not finite or of the wrong length is refused and the motors brake.
        """
        try:
            stacked = np.array(command, dtype=float)
        except ValueError:  # parts of different lengths
            stacked = np.empty(0)
        if stacked.shape != (5, len(self.motor_names)) or not np.isfinite(stacked).all():
            self.rejected_commands += 1
            self.brake()
            return False
        due = self.tick + self._command_delay
        if due == self.tick:
            self._put_in_force(stacked)
        else:
            self._pending.append((due, stacked))
        return True

    def brake(self) -> None:
        """
        Let the motors only resist motion, now and until the next command.

        A motor keeps the damping it was commanded; one without gets BRAKE_DAMPING, or less.
        """
        self._pending.clear()
        kept = -self.model.actuator_biasprm[:, 2]
        damping = np.where(kept > 0.0, kept, self._brake_damping)
        self.model.actuator_biasprm[:, 2] = -damping
        self.model.actuator_biasprm[:, 1] = 0.0
        self.data.ctrl[:] = 0.0

    def push(self, force: Sequence[float], duration: float) -> bool:
        """
        Apply a world-frame force [N], shape (3,), at the root's centre of mass, so long [s].

        It adds to the pushes in force. Return if it was taken: what is not finite is not.
        """
        vector = np.array(force, dtype=float)
        if vector.shape != (3,) or not np.isfinite([*vector, duration]).all():
            return False
        self._pushes.append((self.tick + max(1, round(duration / self.time_step)), vector))
        self._sum_pushes()
        return True

    def contact_forces(self, links: Sequence[str]) -> np.ndarray:
        """
        Return the sum of the normal forces on each link [N], shape (len(links),).

        They belong to the beginning of the last physics step, as contacts are found then.
        """
        forces = dict.fromkeys(links, 0.0)
        wrench = np.zeros(6)
        for index, pair in enumerate(self.data.contact.geom.tolist()):
            touching = {self._link_of_geom[geom] for geom in pair} & forces.keys()
            if touching:
                mujoco.mj_contactForce(self.model, self.data, index, wrench)
                for link in touching:
                    forces[link] += float(wrench[0])
        return np.array([forces[link] for link in links])

    def _sum_pushes(self) -> None:
        total = sum((force for _, force in self._pushes), start=np.zeros(3))
        self.data.xfrc_applied[self.root, :3] = total

    def _put_in_force(self, command: np.ndarray) -> None:
        position, velocity, effort, kp, kd = command
        self.model.actuator_biasprm[:, 1] = -kp
        self.model.actuator_biasprm[:, 2] = -kd
        self.data.ctrl[:] = effort + kp * position + kd * velocity

    def _advance(self, count: int) -> None:
        self.tick += count
        if self.is_kinematic:
            return
        if self._curve is None:
            mujoco.mj_step(self.model, self.data, count)
            return
        for _ in range(count):
            velocity = self.data.qvel[self._motor_velocity]
            self.model.actuator_forcerange[:] = self._curve.limits(velocity)
            mujoco.mj_step(self.model, self.data)
            effort = np.abs(self.data.actuator_force)
            np.maximum(self._peak_effort, effort, out=self._peak_effort)

    def _torque_speed_curve(self) -> TorqueSpeedCurve | None:
        limits = self.setup.speed_limits
        if not all(limits.get(name, 0.0) > 0.0 for name in self.motor_names):
            return None
        torque = self.model.actuator_forcerange[:, 1].copy()
        return TorqueSpeedCurve(torque, np.array([limits[name] for name in self.motor_names]))

    def _true_imu(self) -> ImuReading:
        gyro, accelerometer = self.data.sensor('gyro'), self.data.sensor('accelerometer')
        return ImuReading(self.base().orientation, gyro.data.copy(), accelerometer.data.copy())
