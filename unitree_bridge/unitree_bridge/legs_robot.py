# SPDX-License-Identifier: Apache-2.0
"""A simulated quadruped with our leg controller, as Unitree's interface sees it."""

from collections.abc import Callable
from dataclasses import dataclass
import io
import math

from mujoco_sim.sensors.camera import Frustum, Offscreen
from mujoco_sim.world import World
import numpy as np
from PIL import Image
from quadruped_sim.keys import StateName
from quadruped_sim.legs import Legs
from quadruped_sim.robot_model import JointMap
from quadruped_sim.states.driving import is_up
from wasd_core.errors import SimulationError
from wasd_core.robot_io import BaseOdometry, JointCommand, JointStates
from wasd_core.rotations import matrix_from_quaternion, Pose

from unitree_bridge.remote import Remote
from unitree_bridge.robot import LEGS, MOTORS, Senses, Velocity

# The camera in the head of the Go2: where it is in base axes [m], what it sees.
_EYE = np.array((0.34, 0.0, 0.05))
_WIDTH, _HEIGHT = 1280, 720
_VIEW = Frustum(math.radians(100.0), _WIDTH, _HEIGHT, near=0.05, far=100.0)
_QUALITY = 85


@dataclass
class Commands:
    """
    How commands reach a robot; each returns whether it counts.

    `guard` switches what stops it before obstacles, and returns whether that is on then.
    """

    press: Callable[[str], bool]
    drive: Callable[[Velocity], bool]
    take_motors: Callable[[], bool] = lambda: True
    guard: Callable[[bool], bool] = lambda is_on: False


class LegsRobot:
    """Legs in a world; keys and velocities may be refused, as by E-STOP: see `Commands`."""

    def __init__(self, legs: Legs, world: World, commands: Commands) -> None:
        self._legs, self._world = legs, world
        self.press, self.drive = commands.press, commands.drive
        self.take_motors, self.guard = commands.take_motors, commands.guard
        quadruped = legs.model.quadruped
        self._joints = JointMap(quadruped, world.joint_names, world.motor_names)
        self._feet = quadruped.feet
        self._camera: Offscreen | None = None

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._world.time

    @property
    def state(self) -> StateName:
        """The state of our controller."""
        return StateName(self._legs.state)

    @property
    def coming_state(self) -> StateName:
        """The state that a pressed key leads to, or the present one."""
        return StateName(self._legs.controller.coming_state)

    @property
    def is_up(self) -> bool:
        """Whether its legs hold it about as high as in the stand."""
        robot = self._legs.controller.robot
        return robot is not None and is_up(self._legs.model, robot)

    @property
    def gait(self) -> str:
        """The gait that is chosen."""
        return self._legs.controller.gait

    @property
    def height(self) -> float:
        """Of the base above the ground under its lowest foot [m]."""
        robot = self._legs.controller.robot
        return 0.0 if robot is None else robot.height(self._legs.model.geometry.foot_radius)

    @property
    def odometry(self) -> BaseOdometry | None:
        """Where it believes to be; None before the first reading."""
        return self._legs.odometry

    @property
    def full_speed(self) -> Velocity:
        """How fast full sticks drive it [m/s], [m/s], [rad/s]."""
        limits = self._legs.controller.command_filter.limits
        return limits.forward, limits.lateral, limits.yaw

    @property
    def remote(self) -> Remote:
        """The sticks that keys move, as those of its remote control."""
        sticks = self._legs.controller.sticks.values
        return Remote(sticks.lx, sticks.ly, sticks.rx, sticks.ry)

    def senses(self) -> Senses:
        """Return what it measures now."""
        reading = self._joints.reading(self._world.read())
        assert reading.imu is not None  # the usual setup of a quadruped has one
        forces = self._world.contact_forces(self._feet)[LEGS]
        robot = self._legs.controller.robot
        estimated = np.zeros(4) if robot is None else robot.normal_forces[LEGS]
        joints = JointStates(*(part[MOTORS] for part in reading.joints))
        return Senses(joints, reading.imu, forces, estimated)

    def feet(self) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] of the feet in base axes, (12,) each."""
        robot = self._legs.controller.robot
        if robot is None:
            return np.zeros(12), np.zeros(12)
        motion = robot.motion
        return motion.position[LEGS].ravel(), motion.velocity[LEGS].ravel()

    def motors(self, command: JointCommand) -> JointCommand:
        """Return a command of leg angles as one of the world's motors."""
        return self._joints.command(command)

    def let_go(self) -> None:
        """Stop our controller: from now on it damps."""
        self._legs.controller.e_stop('the motors are released')

    def picture(self) -> bytes:
        """
        Return what the robot sees ahead, as a JPEG of 1280 x 720.

        Raises:
            SimulationError: nothing can be rendered here.
        """
        if self._world.parts.pose is None:
            raise SimulationError('the robot is held in place')
        if self._camera is None:
            self._camera = Offscreen(self._world, _WIDTH, _HEIGHT)
        base = self._world.base()
        turn = matrix_from_quaternion(base.orientation)
        eye = Pose(base.position + turn @ _EYE, turn)
        self._camera.look(self._world.data, eye, _VIEW, (_WIDTH, _HEIGHT))
        written = io.BytesIO()
        Image.fromarray(self._camera.colours()).save(written, 'JPEG', quality=_QUALITY)
        return written.getvalue()

    def close(self) -> None:
        """Release the renderer."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
