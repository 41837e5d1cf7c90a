# SPDX-License-Identifier: Apache-2.0
"""The physics: a robot in a MuJoCo model that is stepped, read and commanded."""

from collections import deque
from collections.abc import Sequence

import mujoco
import numpy as np
from wasd_core.robot_io import BaseState
from wasd_core.robot_io import ImuReading
from wasd_core.robot_io import JointCommand
from wasd_core.robot_io import JointStates
from wasd_core.robot_io import Reading

from mujoco_sim.motors import TorqueSpeedCurve
from mujoco_sim.physics import Physics
from mujoco_sim.robot_parts import RobotParts
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.sensors import NoisySensors
from mujoco_sim.start_pose import put_at_start

FALL_TILT = np.deg2rad(60.0)
# Damping of motors that brake without having been commanded any [N m s/rad]: a Go2 sinks down.
BRAKE_DAMPING = 3.0
# ... but at most this share of what stops a joint within one physics step: motor torques are
# integrated explicitly, which diverges beyond 2 and rings beyond 1.
STABLE_SHARE = 0.5


class World:
    """
    One robot in a compiled model, which it may share with others.

    Keeps the command and the pushes in force; MuJoCo's state and `tick`, the number of physics
    steps so far, are those of its `physics`. Before any command motors are limp. Same seed and
    same calls give the same bits.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec | Physics,
        root: str,
        seed: int = 0,
        setup: RobotSetup | None = None,
        prefix: str = '',
    ) -> None:
        """
        Compile the specification; `root` is the body on the free joint, or held in place.

        A robot that shares a compiled model has a `prefix` there before all its names; here it
        has not. Whoever compiled the model resets it once all robots are in it.

        Raises:
            SimulationError: what the compiler says, in one line.
        """
        self.physics = spec if isinstance(spec, Physics) else Physics(spec)
        self.model, self.data = self.physics.model, self.physics.data
        self.prefix = prefix
        self.parts = RobotParts(self.model, prefix, root)
        self.root = self.parts.root
        self.joint_names, self.motor_names = self.parts.joint_names, self.parts.motor_names
        self._motors = self.parts.motors
        self._motor_velocity = self.parts.velocity[self.parts.motor_joint]
        self.seed = seed
        self.setup = setup or RobotSetup()
        self.rejected_commands = 0
        self.is_kinematic = False  # then it moves by `kinematic.place` only
        self.time_step = self.physics.time_step
        gyro = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, f'{prefix}gyro')
        self.has_imu = gyro >= 0
        self._command_delay = round(self.setup.command_delay / self.time_step)
        self._curve = self._torque_speed_curve()
        self._peak_effort = np.zeros(len(self.motor_names))
        # Of a wheel in the air, the worst case: on the ground it has the robot to move, too.
        stopping = 1.0 / (self.model.dof_invweight0[self._motor_velocity] * self.time_step)
        self._brake_damping = np.minimum(BRAKE_DAMPING, STABLE_SHARE * stopping)
        self.physics.robots.append(self)
        if self.physics is not spec:
            self.reset()

    @property
    def tick(self) -> int:
        """The number of physics steps so far."""
        return self.physics.tick

    @property
    def time(self) -> float:
        """Simulated time since construction [s]; `reset` does not turn it back."""
        return self.physics.tick * self.time_step

    def reset(self) -> None:
        """Put all robots back to where they began, at rest, random numbers, too; time goes on."""
        self.physics.reset()

    def step(self, count: int = 1) -> None:
        """Advance by `count` physics steps; commands and pushes begin and end within them."""
        self.physics.step(count)

    def begin(self) -> None:
        """Begin anew, at the start that the setup says."""
        put_at_start(self.model, self.data, self.parts, self.setup)
        noise = self.setup.noise
        self._sensors = NoisySensors(noise, self.seed) if noise is not None else None
        self._reading: tuple[int, Reading] | None = None
        self._pushes: list[tuple[int, np.ndarray]] = []
        self._pending: deque[tuple[int, np.ndarray]] = deque()
        self._put_in_force(np.zeros((5, len(self.motor_names))))

    def begin_stretch(self) -> int | None:
        """Put in force the commands that are due; return when one or a push changes next."""
        while self._pending and self._pending[0][0] <= self.tick:
            self._put_in_force(self._pending.popleft()[1])
        ends = [end for end, _ in self._pushes]
        if self._pending:
            ends.append(self._pending[0][0])
        return min(ends, default=None)

    def end_stretch(self) -> None:
        """Drop the pushes that are over."""
        if self._pushes:
            self._pushes = [push for push in self._pushes if push[0] > self.tick]
            self._sum_pushes()

    @property
    def limits_change(self) -> bool:
        """Whether the motors' limits depend on their speed."""
        return self._curve is not None

    def before_step(self) -> None:
        """Limit the motors as their speeds allow."""
        if self._curve is not None:
            velocity = self.data.qvel[self._motor_velocity]
            self.model.actuator_forcerange[self._motors] = self._curve.limits(velocity)

    def after_step(self) -> None:
        """Note the largest efforts."""
        effort = np.abs(self.data.actuator_force[self._motors])
        np.maximum(self._peak_effort, effort, out=self._peak_effort)

    def body(self, link: str) -> int:
        """Return the number of the body that is a link; -1 where it is welded into another."""
        return self.parts.body(link)

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
        effort[self.parts.motor_joint] = self.data.actuator_force[self._motors]
        return JointStates(
            self.data.qpos[self.parts.position],
            self.data.qvel[self.parts.velocity],
            effort,
        )

    def take_peak_effort(self) -> np.ndarray:
        """Return the largest effort of each motor since the last call [N m], shape (m,)."""
        peak: np.ndarray = np.maximum(
            self._peak_effort, np.abs(self.data.actuator_force[self._motors])
        )
        self._peak_effort = np.zeros(len(self.motor_names))
        return peak

    def base(self) -> BaseState:
        """Return the root frame as it is, without noise."""
        if self.parts.pose is None:
            pose = self.data.xpos[self.root].copy(), self.data.xquat[self.root].copy()
            return BaseState(*pose, np.zeros(3), np.zeros(3))
        pose, twist = self.data.qpos[self.parts.pose], self.data.qvel[self.parts.twist]
        return BaseState(pose[:3].copy(), pose[3:].copy(), twist[:3].copy(), twist[3:].copy())

    def base_since_start(self) -> BaseState:
        """Return `base` as a perfect odometry has it: counted from the place of the start."""
        base = self.base()
        return base._replace(position=base.position - (*self.setup.place, 0.0))

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
        kept = -self.model.actuator_biasprm[self._motors, 2]
        damping = np.where(kept > 0.0, kept, self._brake_damping)
        self.model.actuator_biasprm[self._motors, 2] = -damping
        self.model.actuator_biasprm[self._motors, 1] = 0.0
        self.data.ctrl[self._motors] = 0.0

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
            touching = {self.parts.link_of_geom[geom] for geom in pair} & forces.keys()
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
        self.model.actuator_biasprm[self._motors, 1] = -kp
        self.model.actuator_biasprm[self._motors, 2] = -kd
        self.data.ctrl[self._motors] = effort + kp * position + kd * velocity

    def _torque_speed_curve(self) -> TorqueSpeedCurve | None:
        limits = self.setup.speed_limits
        if not all(limits.get(name, 0.0) > 0.0 for name in self.motor_names):
            return None
        torque = self.model.actuator_forcerange[self._motors, 1].copy()
        return TorqueSpeedCurve(torque, np.array([limits[name] for name in self.motor_names]))

    def _true_imu(self) -> ImuReading:
        gyro = self.data.sensor(f'{self.prefix}gyro')
        accelerometer = self.data.sensor(f'{self.prefix}accelerometer')
        return ImuReading(self.base().orientation, gyro.data.copy(), accelerometer.data.copy())
