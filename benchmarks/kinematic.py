# SPDX-License-Identifier: Apache-2.0
"""
A robot in a flat without physics: it goes where it is told with lag, and a lidar sees boxes.

Boxes are rows (centre x, y, half length, half width, height, yaw), as flats have them [m, rad].
"""

from dataclasses import dataclass
import math
from pathlib import Path

from mujoco_sim.sensors.lidar import LidarTag
from mujoco_sim.sensors.table import read_sensor_tags
from numba import njit
import numpy as np
from robot_description.description import load_robot
from slam_logs import cast
from wasd_core.parameter_file import NodeKind, read_parameters
from wasd_navigation.parameters import (
    DriveLimits,
    Footprint,
    NavigatorParameters,
    PlanningParameters,
)
from wasd_navigation.records import FREE, Grid, OCCUPIED, read_scan, Scan, UNKNOWN

RATE = 20.0  # of the driver [Hz]
SUBSTEPS = 5
RESOLUTION, BORDER = 0.05, 0.5  # of the grids drawn here [m]


@dataclass(frozen=True)
class Robot:
    """What is simulated and how it is driven."""

    footprint: Footprint
    limits: DriveLimits
    parameters: PlanningParameters
    lidar: LidarTag
    sway: float  # of the trunk, to the sides [m]
    settings: NavigatorParameters  # all of its navigator's, those above among them


def shipped(name: str, sway: float = 0.0) -> Robot:
    """Return a robot with the navigator's file and the description that come with it."""
    path = Path(__file__).resolve().parents[1] / f'wasd_bringup/config/navigator_{name}.yaml'
    kind = NodeKind('navigator', 'the navigator')
    given = read_parameters(str(path), NavigatorParameters, kind)
    settings = NavigatorParameters.from_mapping(given)
    ((lidar,), *_), _ = read_sensor_tags(load_robot(name).robot)
    assert isinstance(lidar, LidarTag)
    return Robot(settings.footprint, settings.limits, settings.planning, lidar, sway, settings)


ROBOTS = {'mbot': shipped('mbot'), 'go2': shipped('go2', sway=0.01)}


def draw_grid(boxes: np.ndarray, corner: np.ndarray, size: np.ndarray) -> Grid:
    """Return the true map of a flat: boxes are obstacles, the rest of its rectangle is free."""
    shape = np.ceil((size[::-1] + 2 * BORDER) / RESOLUTION).astype(int)
    origin = (float(corner[0] - BORDER), float(corner[1] - BORDER))
    grid = Grid(np.full(shape, UNKNOWN, np.int8), RESOLUTION, origin)
    points = grid.to_points(np.argwhere(np.ones(shape, bool)))
    inside = ((points > corner) & (points < corner + size)).all(axis=1)
    cells = np.where(inside, FREE, UNKNOWN).astype(np.int8)
    cells[_covered(points, boxes, 0.5 * RESOLUTION)] = OCCUPIED
    return Grid(cells.reshape(shape), RESOLUTION, origin)


@njit(cache=True)
def _covered(points: np.ndarray, boxes: np.ndarray, half: float) -> np.ndarray:
    """Return which cells, by their middles, shape (n, 2), a box is in by a quarter or so."""
    found = np.zeros(points.shape[0], np.bool_)
    for index in range(points.shape[0]):
        for box in boxes:
            x, y = points[index, 0] - box[0], points[index, 1] - box[1]
            cos, sin = math.cos(box[5]), math.sin(box[5])
            along, across = abs(cos * x + sin * y), abs(cos * y - sin * x)
            found[index] |= along < box[2] + 0.9 * half and across < box[3] + 0.9 * half
    return found


@njit(cache=True)
def gap(pose: np.ndarray, half: tuple[float, float], boxes: np.ndarray) -> float:
    """
    Return how far a rectangle at a pose is from the nearest box [m]; 0 where they overlap.

    `half` are half its length and width. The least distance of two convex polygons is from a
    corner of one to an edge of the other.
    """
    least = np.inf
    for box in boxes:
        reach = math.hypot(half[0], half[1]) + math.hypot(box[2], box[3])
        if math.hypot(pose[0] - box[0], pose[1] - box[1]) - reach > least:
            continue
        own = (pose[0], pose[1], half[0], half[1], pose[2])
        other = (box[0], box[1], box[2], box[3], box[5])
        least = min(least, _corners_to(own, other), _corners_to(other, own))
        if _overlap(own, other) and _overlap(other, own):
            return 0.0
    return least


@njit(cache=True)
def _corners_to(
    first: tuple[float, float, float, float, float],
    second: tuple[float, float, float, float, float],
) -> float:
    """Return the least distance of the corners of a rectangle from another."""
    least = np.inf
    cos, sin = math.cos(first[4]), math.sin(first[4])
    to_cos, to_sin = math.cos(second[4]), math.sin(second[4])
    for along in (-first[2], first[2]):
        for across in (-first[3], first[3]):
            x = first[0] + cos * along - sin * across - second[0]
            y = first[1] + sin * along + cos * across - second[1]
            out = abs(to_cos * x + to_sin * y) - second[2]
            side = abs(to_cos * y - to_sin * x) - second[3]
            least = min(least, math.hypot(max(out, 0.0), max(side, 0.0)))
    return least


@njit(cache=True)
def _overlap(
    first: tuple[float, float, float, float, float],
    second: tuple[float, float, float, float, float],
) -> bool:
    """Whether no axis of the second rectangle separates them."""
    turn = first[4] - second[4]
    cos, sin = abs(math.cos(turn)), abs(math.sin(turn))
    x, y = first[0] - second[0], first[1] - second[1]
    to_cos, to_sin = math.cos(second[4]), math.sin(second[4])
    apart_x = abs(to_cos * x + to_sin * y) > second[2] + cos * first[2] + sin * first[3]
    apart_y = abs(to_cos * y - to_sin * x) > second[3] + sin * first[2] + cos * first[3]
    return not (apart_x or apart_y)


class KinematicRobot:
    """
    Goes where it is told: (vx, vy, wz) with lag, acceleration, and what a real base adds.

    `pose`, shape (3,), is the truth; `seen_pose`, `seen_velocity` and `scan` are what it knows.
    """

    def __init__(self, robot: Robot, pose: np.ndarray, seed: int) -> None:
        self.robot, self.pose = robot, np.array(pose, float)
        self.velocity = np.zeros(3)
        self.time = 0.0
        self._random = np.random.default_rng((seed, 7))
        self._next_scan = float(self._random.uniform(0.0, 1.0 / robot.lidar.rate))
        self._phase = float(self._random.uniform(0.0, 6.0))
        limits = robot.limits
        self._most = np.array((limits.forward, limits.lateral, limits.yaw))
        self._least = np.array((-limits.backward, -limits.lateral, -limits.yaw))
        self._change = (
            1.0
            / RATE
            / SUBSTEPS
            * np.array(
                (
                    limits.forward_acceleration,
                    limits.lateral_acceleration,
                    limits.yaw_acceleration,
                )
            )
        )

    def step(self, asked: np.ndarray) -> None:
        """Go on for one period of the driver."""
        dt = 1.0 / RATE / SUBSTEPS
        wanted = np.clip(asked, self._least, self._most)
        for _ in range(SUBSTEPS):
            share = dt / max(self.robot.limits.lag, dt)
            step = (wanted - self.velocity) * share
            self.velocity = self.velocity + np.clip(step, -self._change, self._change)
            cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
            vx, vy, wz = self.velocity
            self.pose = self.pose + dt * np.array((cos * vx - sin * vy, sin * vx + cos * vy, wz))
            self.time += dt

    @property
    def body(self) -> np.ndarray:
        """Where the body is: its pose with the sway of a walk, shape (3,)."""
        moving = min(1.0, float(np.abs(self.velocity / (self._most + 1e-9)).max()) * 4.0)
        side = moving * self.robot.sway * math.sin(2.0 * math.pi * 2.2 * self.time + self._phase)
        x, y, yaw = self.pose
        return np.array((x - side * math.sin(yaw), y + side * math.cos(yaw), yaw))

    def seen_pose(self) -> np.ndarray:
        """Return the pose as a localiser would: 1 cm and 0.3 degrees off."""
        pose: np.ndarray = self.body + self._random.normal(size=3) * (0.01, 0.01, 0.005)
        return pose

    def seen_velocity(self) -> np.ndarray:
        """Return the velocity as odometry would."""
        velocity: np.ndarray = self.velocity * (1.0 + 0.02 * self._random.normal(size=3))
        return velocity

    def scan(self, boxes: np.ndarray) -> Scan | None:
        """Return the scan that is due now, if any."""
        if self.time < self._next_scan:
            return None
        self._next_scan += 1.0 / self.robot.lidar.rate
        return self._measure(boxes)

    def _measure(self, boxes: np.ndarray) -> Scan:
        lidar = self.robot.lidar
        ranges = cast(self.body, lidar.angles, boxes, lidar.max_range)
        ranges = ranges + self._random.normal(size=len(ranges)) * lidar.noise
        ranges = np.where(ranges > lidar.max_range, np.inf, ranges)
        return read_scan(ranges, lidar.angles, (lidar.min_range, lidar.max_range))

    def gap(self, boxes: np.ndarray) -> float:
        """Return how far the footprint is from the nearest box [m]; at most 0: it touches."""
        footprint = self.robot.footprint
        if footprint.is_circle:
            return gap(self.body, (0.0, 0.0), boxes) - footprint.radius
        return gap(self.body, (footprint.half_length, footprint.half_width), boxes)
