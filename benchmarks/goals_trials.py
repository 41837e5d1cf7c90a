# SPDX-License-Identifier: Apache-2.0
"""Drives of a robot without physics to goals in flats, and what is put into its way."""

from dataclasses import dataclass
import math
import time
from typing import Any

from kinematic import draw_grid, KinematicRobot, RATE, Robot
from mujoco_sim.flats import make_flat
import numpy as np
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.goal_field import ways_from
from wasd_navigation.planning.motion import base_of
from wasd_navigation.planning.route import Route
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import Grid, OCCUPIED

# A drive ends after three times what it takes at full speed, and this [s].
PATIENCE = 60.0
# Nearer goals say nothing of ways [m].
NEAREST = 1.0
# What is put into a way: a box so wide and deep, so far ahead on the way [m].
BOX = (0.2, 0.2)
AHEAD = (1.1, 2.0)
# All of what is left to a goal is drawn in one step.
WHOLE = 1 << 40


@dataclass
class Drive:
    """How a drive to a goal went."""

    goal: np.ndarray
    state: str
    reason: str
    off: float  # from the goal [m]
    turned_off: float  # [rad]
    way: float  # that the robot went [m]
    shortest: float  # that there is for its width [m]
    gap: float  # least distance of the footprint from all obstacles [m]
    took: float  # [s]
    recoveries: int
    steps: list[float]  # CPU time of each [s]
    replanned: float = 0.0  # after something was put into the way [s]

    def record(self, **more: Any) -> dict[str, Any]:
        """Return it as one trial of the JSON."""
        kept = ('state', 'reason', 'off', 'turned_off', 'way', 'shortest', 'gap', 'took')
        own = {name: getattr(self, name) for name in (*kept, 'recoveries', 'replanned')}
        return {**more, 'goal': self.goal.tolist(), **own}


class Course:
    """A flat of a seed with a robot in it that is sent to one goal after the other."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self.robot, self.flat = robot, make_flat(seed)
        self.random = np.random.default_rng((seed, 3))
        self.grid = draw_grid(self.flat.boxes, self.flat.corner, self.flat.size)
        self.moving = KinematicRobot(robot, np.zeros(3), seed)
        self.driver = Driver(robot.limits, robot.footprint, robot.parameters)

    def choose_goal(self, nearest: float = NEAREST) -> np.ndarray:
        """Return a random goal that can be reached from where the robot is."""
        around = self._surroundings(self.grid)
        while True:
            goal = self._anywhere()
            if self._route(goal).refusal(around) is not None:
                continue
            if not nearest <= self.shortest(goal) < math.inf:
                continue
            if self._is_reached(goal, around):
                return goal

    def _route(self, goal: np.ndarray) -> Route:
        robot = self.robot
        return Route(goal, robot.footprint, base_of(robot.limits), robot.parameters)

    def _is_reached(self, goal: np.ndarray, around: Surroundings) -> bool:
        """Whether a way leads to a goal from where the robot is."""
        pose, route = self.moving.pose, self._route(goal)
        route.draw(around)
        while route.is_drawing:
            route.work(pose, WHOLE)
        return route.left(pose) < math.inf

    def choose_shut_off(self) -> tuple[np.ndarray, Grid, str]:
        """Return a goal that cannot be reached, the map, and what makes it so."""
        kinds = ('in an obstacle', 'outside the map', 'unknown', 'behind closed doors')
        kind = kinds[int(self.random.integers(len(kinds)))]
        flat, grid, goal = self.flat, self.grid, self._anywhere()
        box = flat.boxes[self.random.integers(len(flat.boxes))]
        if kind == 'in an obstacle':
            goal[:2] = box[:2]
        elif kind == 'outside the map':
            goal[:2] = flat.corner - self.random.uniform(1.0, 9.0, size=2)
        elif kind == 'unknown':
            goal[:2] = flat.corner - (0.3, 0.3)
        else:
            away = np.hypot(*(0.5 * (flat.rooms[:, :2] + flat.rooms[:, 2:])).T)
            room = flat.rooms[away > 1.0][self.random.integers((away > 1.0).sum())]
            goal[:2] = self._free_in(room)
            doors = np.array([closed(door) for door in flat.doors])
            grid = draw_grid(np.concatenate((flat.boxes, doors)), flat.corner, flat.size)
        return goal, grid, kind

    def _free_in(self, room: np.ndarray) -> np.ndarray:
        around = self._surroundings(self.grid)
        while True:
            goal = np.append(self.random.uniform(room[:2], room[2:]), 0.0)
            if self._route(goal).refusal(around) is None:
                return goal[:2]

    def _anywhere(self) -> np.ndarray:
        flat = self.flat
        place = self.random.uniform(flat.corner, flat.corner + flat.size)
        return np.append(place, self.random.uniform(-math.pi, math.pi))

    def _surroundings(self, grid: Grid) -> Surroundings:
        around = Surroundings(self.robot.footprint, self.robot.parameters)
        around.take_map(grid, 0, np.zeros(2))
        return around

    def shortest(self, goal: np.ndarray) -> float:
        """Return the shortest way for a disc as wide as the robot's narrower side [m]."""
        # Of all of the flat: the surroundings of a large one are a part of it.
        distances = measure_distances(self.grid.cells == OCCUPIED, self.grid.resolution)
        reach = self.robot.footprint.inscribed
        price = np.where(distances > reach, 1.0, np.inf).astype(np.float32)
        here, there = self.grid.to_cells(np.stack((self.moving.pose[:2], goal[:2])))
        return float(ways_from(there, price, self.grid.resolution)[tuple(here)])

    def drive(self, goal: np.ndarray, trouble: 'Trouble | None' = None) -> Drive:
        """Send the robot to a goal and see how it gets there."""
        moving, driver = self.moving, self.driver
        shortest, begin = self.shortest(goal), moving.time
        patience = 3.0 * min(shortest, 50.0) / self.robot.limits.forward + PATIENCE
        boxes, way, gap = self.flat.boxes, 0.0, math.inf
        steps: list[float] = []
        driver.set_goal(goal)
        while moving.time - begin < patience:
            at = time.thread_time()
            scan = moving.scan(boxes)
            asked = driver.step(
                self.grid, 0, moving.seen_pose(), moving.seen_velocity(), scan, 1.0 / RATE
            )
            steps.append(time.thread_time() - at)
            before = moving.pose
            moving.step(asked)
            way += math.dist(before[:2], moving.pose[:2])
            if trouble is not None:
                boxes = trouble.step(self, boxes, way)
            gap = min(gap, moving.gap(boxes))
            if not driver.is_under_way:
                break
        off = moving.pose - goal
        drive = Drive(
            goal=goal,
            state=driver.state,
            reason=driver.reason,
            off=math.hypot(off[0], off[1]),
            turned_off=abs(math.remainder(off[2], 2.0 * math.pi)),
            way=way,
            shortest=shortest,
            gap=gap,
            took=moving.time - begin,
            recoveries=driver.recoveries,
            steps=steps,
            replanned=0.0 if trouble is None else trouble.replanned,
        )
        if driver.state != 'arrived':
            moving.pose, moving.velocity = goal.copy(), np.zeros(3)
            driver.reset()
        return drive


def closed(door: np.ndarray) -> np.ndarray:
    """Return a box that closes a door (x, y, width, yaw), shape (6,)."""
    return np.array((door[0], door[1], 0.5 * door[2], 0.03, 0.7, door[3]))


class Trouble:
    """
    Puts a box into the way, or closes the next door, once the robot has gone `begin` [m].

    `replanned` is how long the way then still led through what was put there, from when the lidar
    could see it on [s].
    """

    def __init__(self, begin: float, is_door: bool) -> None:
        self._begin, self._is_door = begin, is_door
        self.put: np.ndarray | None = None
        self._seen, self._is_over = math.inf, False
        self.replanned = 0.0

    def step(self, course: Course, boxes: np.ndarray, way: float) -> np.ndarray:
        """Return what there is now, shape (n, 6), when the robot has gone some way [m]."""
        if self.put is None:
            if way >= self._begin:
                self.put = self._choose(course)
            return boxes if self.put is None else np.concatenate((boxes, self.put[None]))
        now = course.moving.time
        if self._seen == math.inf and _is_seen(course, boxes, self.put):
            self._seen = now
        if not self._is_over and self._seen <= now:
            self.replanned = now - self._seen
            self._is_over = not self._leads_through(course)
        return boxes

    def _choose(self, course: Course) -> np.ndarray | None:
        path = course.driver.path
        if course.driver.state != 'driving' or len(path) < 2:
            return None
        ahead = np.append(0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T)))
        if self._is_door:
            for door in course.flat.doors:
                apart = np.hypot(*(path - door[:2]).T)
                nearest = int(apart.argmin())
                if apart[nearest] < 0.4 and AHEAD[0] - 0.3 < ahead[nearest] < AHEAD[1]:
                    return closed(door)
            return None
        where = float(course.random.uniform(*AHEAD))
        if ahead[-1] < where + 0.7:
            return None
        x, y = path[int(np.searchsorted(ahead, where))]
        yaw = float(course.random.uniform(0.0, math.pi))
        return np.array((x, y, *BOX, 0.7, yaw))

    def _leads_through(self, course: Course) -> bool:
        driver, put = course.driver, self.put
        assert put is not None
        if driver.state != 'driving' or not len(driver.path):
            return False
        points = driver.path - put[:2]
        cos, sin = math.cos(put[5]), math.sin(put[5])
        along = np.abs(points @ (cos, sin)) - put[2]
        across = np.abs(points @ (-sin, cos)) - put[3]
        return bool((np.hypot(along.clip(0.0), across.clip(0.0)) < 0.1).any())


def _is_seen(course: Course, boxes: np.ndarray, put: np.ndarray) -> bool:
    """Whether the lidar has a clear view of the middle of what was put there."""
    pose = course.moving.pose
    to = put[:2] - pose[:2]
    distance = float(np.hypot(*to))
    share = np.linspace(0.0, 1.0, 60)[:-1, None]
    line = pose[:2] + share * to * max(distance - 0.4, 0.0) / distance
    for box in boxes[:-1]:
        cos, sin = math.cos(box[5]), math.sin(box[5])
        points = line - box[:2]
        along, across = np.abs(points @ (cos, sin)), np.abs(points @ (-sin, cos))
        if ((along < box[2]) & (across < box[3])).any():
            return False
    return True
