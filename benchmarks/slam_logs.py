# SPDX-License-Identifier: Apache-2.0
"""
Logs of a robot with a planar lidar that is driven through a flat, made without physics.

True poses along ways between random places, an odometry that errs as a kind of robot does, and
rays against the flat's boxes. The same seed gives the same log.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
import time
from typing import NamedTuple

from diff_drive_sim.odometry import grow_covariance, Growth, PlanarCovariance
from mujoco_sim.flats import Flat
from mujoco_sim.parameters import HONEST, IDEAL
from mujoco_sim.sensors.lidar import LidarTag, with_model
from mujoco_sim.sensors.table import read_sensor_tags
from numba import njit
import numpy as np
from robot_description.description import load_robot
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.odometry import moves_between
from wasd_navigation.records import read_scan, Scan
from wasd_navigation.se2 import compose, inverse

TICK = 0.02  # [s]
CELL = 0.05  # [m]
CLEARANCE = 0.30  # of the way from the walls [m]
LOOK_AHEAD = 0.35  # [m]


def lidar_of(name: str, model: str = HONEST) -> LidarTag:
    """Return a robot's lidar as its description has it, or as another model would measure."""
    tags = read_sensor_tags(load_robot(name).robot).kinds[0]
    (tag,) = (tag for tag in tags if isinstance(tag, LidarTag))
    return tag if model == HONEST else with_model(tag, model)


A1, MBOT_LIDAR = lidar_of('mbot'), lidar_of('mbot', IDEAL)
S2, GO2_LIDAR = lidar_of('go2'), lidar_of('go2', IDEAL)


class Wheels(NamedTuple):
    """
    How an odometry errs, and how it says so.

    `scale` and `turn_scale` are standard deviations of errors that last, as shares of the way
    and of the turn; `drift` of a heading that wanders [rad/sqrt(m)], `slip` of the place
    [m/sqrt(m)]; `growth` is what its messages say of themselves.
    """

    scale: float
    turn_scale: float
    drift: float
    slip: float
    growth: Growth


# mbot's own word is that of diff_drive_controller.yaml.
ODOMETRIES = {
    'mbot': Wheels(5e-4, 5e-4, 1.4e-3, 5e-4, Growth(2.5e-5, 1e-4, 1e-5)),
    'go2': Wheels(0.01, 0.01, 3e-3, 3e-3, Growth(1e-4, 1e-4, 2e-5)),
    # What lasts is 3 %: tyres that have lost pressure, a load.
    '3 %': Wheels(0.03, 0.03, 3e-3, 3e-3, Growth(9e-4, 9e-4, 5e-5)),
    'poor': Wheels(0.05, 0.04, 6e-3, 6e-3, Growth(2.5e-3, 1.6e-3, 1e-4)),
}


@dataclass(frozen=True)
class Log:
    """Scans, and at their stamps the true pose and odometry's with its covariance."""

    stamps: np.ndarray  # (n,) [s]
    truth: np.ndarray  # (n, 3)
    odometry: np.ndarray  # (n, 3)
    covariances: np.ndarray  # (n, 3, 3)
    scans: list[Scan]

    @property
    def length(self) -> float:
        """Length of the true way [m]."""
        steps = np.diff(self.truth[:, :2], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


@njit(cache=True)
def cast(pose: np.ndarray, angles: np.ndarray, boxes: np.ndarray, most: float) -> np.ndarray:
    """Return how far rays go to the next of boxes (as `Flat` has them) [m]; inf beyond `most`."""
    ranges = np.full(angles.shape[0], np.inf)
    for box in boxes:
        cos, sin = math.cos(box[5]), math.sin(box[5])
        dx, dy = pose[0] - box[0], pose[1] - box[1]
        x, y = cos * dx + sin * dy, -sin * dx + cos * dy
        if math.hypot(x, y) > most + math.hypot(box[2], box[3]):
            continue
        for ray in range(angles.shape[0]):
            angle = pose[2] + angles[ray] - box[5]
            near, far = 0.0, most
            for place, direction, half in (
                (x, math.cos(angle), box[2]),
                (y, math.sin(angle), box[3]),
            ):
                if abs(direction) < 1e-12:
                    if abs(place) > half:
                        near = np.inf
                    continue
                first, last = (-half - place) / direction, (half - place) / direction
                near = max(near, min(first, last))
                far = min(far, max(first, last))
            if near <= far and near < ranges[ray]:
                ranges[ray] = near
    return ranges


@njit(cache=True)
def surface_distance(points: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Return how far points are from the next surface [m], shape (n,); negative inside a box."""
    distances = np.full(points.shape[0], np.inf)
    for box in boxes:
        cos, sin = math.cos(box[5]), math.sin(box[5])
        for index in range(points.shape[0]):
            dx, dy = points[index, 0] - box[0], points[index, 1] - box[1]
            x = abs(cos * dx + sin * dy) - box[2]
            y = abs(-sin * dx + cos * dy) - box[3]
            outside = math.hypot(max(x, 0.0), max(y, 0.0))
            distances[index] = min(distances[index], outside + min(0.0, max(x, y)))
    return distances


@njit(cache=True)
def goal_field(costs: np.ndarray, row: int, column: int) -> np.ndarray:
    """Return the least cost of a way to a cell from each other, by sweeps; inf where none is."""
    rows, columns = costs.shape
    field = np.full((rows, columns), np.inf)
    field[row, column] = 0.0
    changed = True
    while changed:
        changed = False
        for sweep in range(4):
            down, right = sweep % 2 == 0, sweep < 2
            for i in range(1, rows - 1):
                r = i if down else rows - 1 - i
                for j in range(1, columns - 1):
                    c = j if right else columns - 1 - j
                    if costs[r, c] == np.inf:
                        continue
                    least = field[r, c]
                    for dr in range(-1, 2):
                        for dc in range(-1, 2):
                            step = math.sqrt(float(dr * dr + dc * dc))
                            least = min(least, field[r + dr, c + dc] + step * costs[r, c])
                    if least < field[r, c] - 1e-9:
                        field[r, c] = least
                        changed = True
    return field


def find_way(field: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
    """Return the cells (row, column) of a way down a field, shape (n, 2)."""
    way = [cell]
    while field[cell] > 0.0:
        r, c = cell
        around = [(r + i, c + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        cell = min(around, key=lambda near: float(field[near]))
        way.append(cell)
    return np.array(way)


def drive(flat: Flat, length: float, seed: int) -> np.ndarray:
    """
    Return true poses at each tick of a drive of a length [m] at least, shape (n, 3).

    It goes from the origin to random places that can be reached, one after the other.
    """
    random = np.random.default_rng((seed, 1))
    shape = tuple(int(math.ceil(side / CELL)) for side in flat.size[::-1])
    grid = np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), axis=-1)
    centres = flat.corner + (grid.reshape(-1, 2) + 0.5) * CELL
    far = surface_distance(centres, flat.boxes).reshape(shape)
    costs = np.where(far > CLEARANCE, 1.0 + 2.0 * np.clip(0.6 - far, 0.0, None), np.inf)
    start = tuple(((-flat.corner) / CELL).astype(int)[::-1].tolist())
    reached = goal_field(costs, *start)
    places = np.argwhere(np.isfinite(reached))
    pose = np.zeros(3)
    poses = [pose]
    travelled = 0.0
    while travelled < length:
        goal = places[random.integers(len(places))]
        field = goal_field(costs, *goal)
        here = (pose[:2] - flat.corner)[::-1] / CELL - 0.5
        # The nearest of them: corners are cut a little.
        cell = tuple(places[np.argmin(((places - here) ** 2).sum(axis=1))].tolist())
        if field[cell] < 40.0:
            continue
        way = flat.corner + (find_way(field, cell)[:, ::-1] + 0.5) * CELL
        followed = follow(pose, way)
        travelled += float(np.hypot(*np.diff(followed[:, :2], axis=0).T).sum())
        poses.extend(followed[1:])
        pose = poses[-1]
    return np.array(poses)


@njit(cache=True)
def follow(pose: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return poses at each tick along a way, shape (n, 2) [m], at 0.5 m/s and 1 rad/s at most."""
    poses = [pose]
    at, speed, turn = 0, 0.0, 0.0
    while at < way.shape[0] - 1:
        pose = poses[-1]
        while at < way.shape[0] - 1 and (
            math.hypot(way[at, 0] - pose[0], way[at, 1] - pose[1]) < LOOK_AHEAD
        ):
            at += 1
        ahead = math.atan2(way[at, 1] - pose[1], way[at, 0] - pose[0]) - pose[2]
        ahead = (ahead + math.pi) % (2.0 * math.pi) - math.pi
        wanted = min(1.0, max(-1.0, 2.5 * ahead))
        turn += min(0.08, max(-0.08, wanted - turn))
        wanted = 0.5 * max(0.0, 1.0 - abs(ahead) / 0.8)
        speed += min(0.02, max(-0.02, wanted - speed))
        heading = pose[2] + 0.5 * turn * TICK
        poses.append(
            np.array(
                (
                    pose[0] + speed * TICK * math.cos(heading),
                    pose[1] + speed * TICK * math.sin(heading),
                    (pose[2] + turn * TICK + math.pi) % (2.0 * math.pi) - math.pi,
                )
            )
        )
    result = np.empty((len(poses), 3))
    for index, each in enumerate(poses):
        result[index] = each
    return result


def err(poses: np.ndarray, wheels: Wheels, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what an odometry says of true poses: poses (n, 3) and covariances (n, 3, 3)."""
    random = np.random.default_rng((seed, 2))
    scale = 1.0 + wheels.scale * (1.0 if random.random() < 0.5 else -1.0)
    turn_scale = 1.0 + wheels.turn_scale * (1.0 if random.random() < 0.5 else -1.0)
    noise = random.normal(size=(len(poses), 3))
    odometry, covariances = np.empty_like(poses), np.zeros((len(poses), 3, 3))
    odometry[0] = poses[0]
    known = PlanarCovariance()
    for index in range(1, len(poses)):
        move = compose(inverse(poses[index - 1]), poses[index])
        way = math.hypot(move[0], move[1])
        root = math.sqrt(way)
        seen = np.array((move[0] * scale, move[1] * scale, move[2] * turn_scale))
        seen += noise[index] * root * np.array((wheels.slip, wheels.slip, wheels.drift))
        before = odometry[index - 1]
        odometry[index] = after = compose(before, seen)
        known = grow_covariance(
            known,
            wheels.growth,
            way,
            float(seen[2]),
            float(before[2]),
            (float(after[0] - before[0]), float(after[1] - before[1])),
        )
        covariances[index] = as_matrix(known)
    return odometry, covariances


def as_matrix(known: PlanarCovariance) -> np.ndarray:
    """Return a covariance as a matrix, shape (3, 3)."""
    xx, xy, yy, xt, yt, tt = known
    return np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, tt)))


@njit(cache=True)
def cast_each(poses: np.ndarray, angles: np.ndarray, boxes: np.ndarray, most: float) -> np.ndarray:
    """Return how far each ray goes from the pose that is its own, shape (n, 3)."""
    ranges = np.empty(angles.shape[0])
    for ray in range(angles.shape[0]):
        ranges[ray] = cast(poses[ray], angles[ray : ray + 1], boxes, most)[0]
    return ranges


class Way:
    """Poses of a robot, shape (n, 3), at some times, and between them."""

    def __init__(self, times: np.ndarray, poses: np.ndarray) -> None:
        self._times = times
        self._columns = poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the poses at some times [s], shape (m, 3)."""
        return np.stack([np.interp(times, self._times, c) for c in self._columns], axis=1)


def look(truth: np.ndarray, boxes: np.ndarray, lidar: LidarTag, seed: Sequence[int]) -> np.ndarray:
    """Return the ranges that a lidar measures from true poses of its rays, shape (samples, 3)."""
    farthest = lidar.max_range + 6.0 * float(lidar.deviations(np.array(lidar.max_range)))
    ranges = cast_each(truth, lidar.angles, boxes, farthest)
    return lidar.err(ranges, np.random.default_rng(seed))


def make_logs(
    flat: Flat, odometries: Sequence[str], seed: int, length: float, lidar: LidarTag = MBOT_LIDAR
) -> dict[str, Log]:
    """
    Return logs of a drive of a length [m] at least through a flat, by their odometries.

    Of a lidar that turns a scan is told of the middle of its revolution; where the robot was at
    each ray, odometry says.
    """
    return log_way(drive(flat, length, seed), flat.boxes, odometries, seed, lidar)


def log_way(
    poses: np.ndarray,
    boxes: np.ndarray,
    odometries: Sequence[str],
    seed: int,
    lidar: LidarTag,
) -> dict[str, Log]:
    """Return logs of true poses at each tick, shape (n, 3), among boxes; see `make_logs`."""
    ticks = np.arange(len(poses)) * TICK
    rays = lidar.time_increment * np.arange(lidar.samples)
    begins = np.arange(int((ticks[-1] - rays[-1]) * lidar.rate)) / lidar.rate
    rows = np.round((begins + 0.5 * rays[-1]) / TICK).astype(int)
    true = Way(ticks, poses)
    ranges = [
        look(true.at(begin + rays), boxes, lidar, (seed, 3, index))
        for index, begin in enumerate(begins.tolist())
    ]
    logs = {}
    for name in odometries:
        said, covariances = err(poses, ODOMETRIES[name], seed)
        way = Way(ticks, said)
        scans = []
        for begin, row, seen in zip(begins.tolist(), rows, ranges, strict=True):
            moved = moves_between(said[row], way.at(begin + rays)) if lidar.turns else None
            limits = (lidar.min_range, lidar.max_range)
            scans.append(read_scan(seen, lidar.angles, limits, moved=moved))
        logs[name] = Log(ticks[rows], poses[rows], said[rows], covariances[rows], scans)
    return logs


def take_in(mapper: Mapper | Localizer, log: Log, row: int) -> float:
    """Take in one scan of a log, and return its CPU time [ms]."""
    begin = time.thread_time()
    mapper.step(log.scans[row], log.odometry[row], log.covariances[row])
    return 1e3 * (time.thread_time() - begin)
