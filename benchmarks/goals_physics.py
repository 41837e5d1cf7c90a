# SPDX-License-Identifier: Apache-2.0
"""
The same drives with physics: wheels that a motor turns, legs that walk, their own lidars; no ROS.

Nobody has to find out where the robot is: the driver gets the truth, off as a localiser is.
"""

import math

from kinematic import KinematicRobot, RATE, Robot
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.mount import Site
import numpy as np
from robot_description.description import load_robot
import wasd
from wasd_core.rotations import Pose, yaw_matrix
from wasd_navigation.records import read_tilted_scan, Scan

# The Go2 stands up, and then walks, before it is sent anywhere [s].
STAND, WALK = 2.5, 0.5


class PhysicalRobot(KinematicRobot):
    """mbot or the Go2 in MuJoCo; what it knows of itself is the truth with a localiser's noise."""

    def __init__(self, name: str, robot: Robot, world: str, seed: int) -> None:
        super().__init__(robot, np.zeros(3), seed)
        self._go2: wasd.Go2 | None = None
        self._mbot: wasd.Mbot | None = None
        if name == 'go2':
            self._go2 = wasd.Go2(world, seed)
            self._go2.press('2')
            self._go2.run(STAND)
            self._go2.press('5')
            self._go2.run(WALK)
        else:
            self._mbot = wasd.Mbot(world, seed)
        self._world = (self._go2 or self._mbot)._world  # type: ignore[union-attr]
        self._site = Site(self._world, load_robot(name).robot)
        self._lidar = Lidar(robot.lidar, self._site)
        self._mount = self._site.find_mount(robot.lidar.link, robot.lidar.pose)
        self._look()
        self._next_scan += self.time

    @property
    def body(self) -> np.ndarray:
        """Where the body is, shape (3,)."""
        return self.pose

    def step(self, asked: np.ndarray) -> None:
        """Go on for one period of the driver."""
        if self._go2 is not None:
            self._go2.drive(*asked.tolist())
            self._go2.run(1.0 / RATE)
        elif self._mbot is not None:
            self._mbot.drive(float(asked[0]), float(asked[2]))
            self._mbot.run(1.0 / RATE)
        self._look()

    def _measure(self, boxes: np.ndarray) -> Scan:
        """Return what the lidar of the description sees in the simulated flat."""
        lidar, place = self.robot.lidar, self._mount.in_world(self._site.snapshot.take())
        back = yaw_matrix(-float(self.pose[2]))
        level = Pose(-back @ (*self.pose[:2], 0.0), back) @ place
        return read_tilted_scan(
            self._lidar.scan(self._random),
            lidar.angles,
            (lidar.min_range, lidar.max_range),
            level,
        )

    def _look(self) -> None:
        robot = self._go2 or self._mbot
        assert robot is not None
        truth = robot.truth
        x, y, yaw = *truth.position[:2].tolist(), float(truth.rpy[2])
        self.pose = np.array((x, y, yaw))
        cos, sin = math.cos(yaw), math.sin(yaw)
        vx, vy = truth.linear_velocity[:2].tolist()
        turning = float(truth.angular_velocity[2])
        self.velocity = np.array((cos * vx + sin * vy, cos * vy - sin * vx, turning))
        self.time = robot.time
