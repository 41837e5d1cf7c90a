# SPDX-License-Identifier: Apache-2.0
"""
The same drives with physics: wheels that a motor turns, legs that walk, their own lidars; no ROS.

Nobody has to find out where the robot is: the driver gets the truth, off as a localiser is. Its
scans are those of a run: a lidar that turns sees each ray at its own time, and the robot's own
odometry says where that was.
"""

import math

from kinematic import KinematicRobot, RATE, Robot
import numpy as np
import wasd
from wasd_bringup.run.guarding import RobotGuard
from wasd_bringup.run.sensing import lidar_of, listen_to_lidar
from wasd_navigation.odometry import Odometry
from wasd_navigation.records import Scan
from wasd_navigation.se2 import compose, inverse
from wasd_navigation.senses import Senses

# The Go2 stands up, and then walks, before it is sent anywhere [s].
STAND, WALK = 2.5, 0.5


class PhysicalRobot(KinematicRobot):
    """
    mbot or the Go2 in MuJoCo; what it knows of itself is the truth with a localiser's noise.

    It may have a guard, as by --guard.
    """

    def __init__(
        self, name: str, robot: Robot, world: str, seed: int, guards: bool = False
    ) -> None:
        super().__init__(robot, np.zeros(3), seed)
        self._script = wasd.Go2(world, seed) if name == 'go2' else wasd.Mbot(world, seed)
        self._unit = self._script._robot
        if guards:
            RobotGuard(self._unit)
        self._senses = Senses()
        self._senses.on_scan = self._see
        self._seen: tuple[Scan, np.ndarray] | None = None
        tag = lidar_of(self._unit)
        listen_to_lidar(self._unit, tag, self._senses, self._tell_odometry)
        if name == 'go2':
            self._script.press('2')
            self._script.run(STAND)
            self._script.press('5')
            self._script.run(WALK)
        self._look()

    @property
    def body(self) -> np.ndarray:
        """Where the body is, shape (3,)."""
        return self.pose

    def step(self, asked: np.ndarray) -> None:
        """Go on for one period of the driver."""
        vx, vy, wz = asked.tolist()
        if isinstance(self._script, wasd.Go2):
            self._script.drive(vx, vy, wz)
        else:
            self._script.drive(vx, wz)
        self._script.run(1.0 / RATE)
        self._look()

    def scan(self, boxes: np.ndarray) -> Scan | None:
        """Return a scan that has come since the last call, in the base frame of now."""
        if self._seen is None:
            return None
        (scan, at), self._seen = self._seen, None
        return scan.seen_from(compose(inverse(self._pose_said), at))

    def _see(self, scan: Scan, odometry: Odometry, *_: float) -> None:
        self._seen = scan, odometry.pose

    def _tell_odometry(self) -> None:
        if self._unit.odometry is None:
            return
        now = self._unit.world.time
        said = self._senses.read_odometry(now, self._unit.odometry, self._unit.frames)
        if said is not None:
            self._pose_said = said.pose
            self._senses.add_odometry(now, said)

    def _look(self) -> None:
        self._tell_odometry()
        truth = self._script.truth
        yaw = float(truth.rpy[2])
        self.pose = np.array((*truth.position[:2], yaw))
        cos, sin = math.cos(yaw), math.sin(yaw)
        vx, vy = truth.linear_velocity[:2].tolist()
        turning = float(truth.angular_velocity[2])
        self.velocity = np.array((cos * vx + sin * vy, cos * vy - sin * vx, turning))
        self.time = self._script.time
