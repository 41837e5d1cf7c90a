# SPDX-License-Identifier: Apache-2.0
"""The physics: a robot in a MuJoCo model that is stepped, read and commanded."""

from collections.abc import Sequence

import mujoco
import numpy as np
from wasd_core.robot_io import BaseState
from wasd_core.robot_io import ImuReading
from wasd_core.robot_io import JointCommand
from wasd_core.robot_io import JointStates
from wasd_core.robot_io import Reading

from mujoco_sim.physics import Actuation
from mujoco_sim.physics import Physics
from mujoco_sim.physics import RobotParts
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.sensors import NoisySensors

FALL_TILT = np.deg2rad(60.0)


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
        self.seed = seed
        self.setup = setup or RobotSetup()
        self.time_step = self.physics.time_step
        gyro = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, f'{prefix}gyro')
        self.has_imu = gyro >= 0
        self._sensors: NoisySensors | None = None
        # How often was reset, and the tick, when the sensors were read last.
        self._read_at = (-1, -1)
        self._actuation = Actuation(self.model, self.data, self.parts, self.setup)
        self.physics.robots.append(self._actuation)
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

    @property
    def is_kinematic(self) -> bool:
        """Whether it moves by `kinematic.place` only."""
        return self._actuation.is_kinematic

    @is_kinematic.setter
    def is_kinematic(self, is_kinematic: bool) -> None:
        self._actuation.is_kinematic = is_kinematic

    @property
    def rejected_commands(self) -> int:
        """How many commands were refused."""
        return self._actuation.rejected_commands

    def body(self, link: str) -> int:
        """Return the number of the body that is a link; -1 where it is welded into another."""
        return self.parts.body(link)

    def read(self) -> Reading:
        """Return what the sensors measure now; asked twice in one instant, they say the same."""
        now = (self.physics.resets, self.tick)
        if now[0] != self._read_at[0]:
            noise = self.setup.noise
            self._sensors = NoisySensors(noise, self.seed) if noise is not None else None
        if now != self._read_at:
            true = Reading(self.joints(), self._true_imu() if self.has_imu else None)
            self._reading = true if self._sensors is None else self._sensors.measure(true)
            self._read_at = now
        return self._reading

    def joints(self) -> JointStates:
        """Return the joints without noise; the efforts are those in the last physics step."""
        effort = np.zeros(len(self.joint_names))
        effort[self.parts.motor_joint] = self.data.actuator_force[self.parts.motors]
        return JointStates(
            self.data.qpos[self.parts.position],
            self.data.qvel[self.parts.velocity],
            effort,
        )

    def take_peak_effort(self) -> np.ndarray:
        """Return the largest effort of each motor since the last call [N m], shape (m,)."""
        return self._actuation.take_peak_effort()

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
        return self._actuation.apply(command, self.tick)

    def brake(self) -> None:
        """
        Let the motors only resist motion, now and until the next command.

        A motor keeps the damping it was commanded; one without gets BRAKE_DAMPING, or less.
        """
        self._actuation.brake()

    def push(self, force: Sequence[float], duration: float) -> bool:
        """
        Apply a world-frame force [N], shape (3,), at the root's centre of mass, so long [s].

        It adds to the pushes in force. Return if it was taken: what is not finite is not.
        """
        vector = np.array(force, dtype=float)
        if vector.shape != (3,) or not np.isfinite([*vector, duration]).all():
            return False
        self._actuation.push(vector, duration, self.tick)
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

    def _true_imu(self) -> ImuReading:
        gyro = self.data.sensor(f'{self.prefix}gyro')
        accelerometer = self.data.sensor(f'{self.prefix}accelerometer')
        return ImuReading(self.base().orientation, gyro.data.copy(), accelerometer.data.copy())
