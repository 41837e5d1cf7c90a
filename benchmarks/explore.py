# SPDX-License-Identifier: Apache-2.0
"""
Exploring of flats that nobody has seen, and goals in them then; without physics.

A robot drives by its own map and its own pose. What is measured is measured by the truth.

The lidar is the ideal one (1 cm of noise), odometry errs as each robot's does.
"""

from collections.abc import Callable
import dataclasses
from functools import partial
import math
from typing import Any

from cores import all_on_cores
from goals_trials import closed, Course, NEAREST
from kinematic import draw_grid, RATE, ROBOTS
import numpy as np
from slam_logs import ODOMETRIES
from table import format_count, Row
from wasd_core.rotations import Pose
from wasd_navigation.odometry import Odometry
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import flood, ways_from
from wasd_navigation.records import FREE, OCCUPIED, UNKNOWN
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose, inverse

FIRST_SEED = 7000
LONGEST = 900.0  # [s]
# Goals in each flat that was explored, and how long each may take [s].
GOALS, PATIENCE = 5, 180.0
# Goals in each flat that nobody has looked at, the first of them no nearer than this [m]; of so
# many at least this share is to be reached. One that cannot be may take so long to be ruled out.
UNSEEN, FAR, MOST = 2, 3.0, 0.95
LONGEST_SEARCH = 300.0
# How near by the truth each must be [m], [rad]: what the navigator asks for, and its map's error.
NEAR, TURNED = 0.10, math.radians(5.0)
KNOWN, LONGER = 0.98, 1.5
LEVEL = Pose(np.zeros(3), np.eye(3))


class Ride:
    """
    A robot in a flat that knows what it sees: it drives by its own map and its own pose.

    `believed` is where its odometry has it, which errs by a scale and a drift of its own.
    """

    def __init__(self, name: str, seed: int) -> None:
        self.course = Course(ROBOTS[name], seed)
        robot, self.flat, self.moving = self.course.robot, self.course.flat, self.course.moving
        self.unit = RobotNavigator(robot.settings)
        self._asked = np.zeros(3)
        self.unit.send = self._ask
        self._wheels = ODOMETRIES[name]
        self._random = np.random.default_rng((seed, 71))
        scale, turn_scale = 1.0 + self._random.normal(size=2) * (
            self._wheels.scale,
            self._wheels.turn_scale,
        )
        self._scales = np.array((scale, scale, turn_scale))
        self._believed, self._covariance = np.zeros(3), 1e-6 * np.eye(3)
        self.way, self.least = 0.0, math.inf

    def _ask(self, velocity: np.ndarray) -> None:
        self._asked = velocity

    def step(self) -> None:
        """Go on for a period of the driver."""
        moving, unit, before = self.moving, self.unit, self.moving.pose
        odometry = Odometry(self._believed, moving.velocity, self._covariance.copy(), LEVEL)
        unit.navigator.move(odometry)
        scan = moving.scan(self.flat.boxes)
        if scan is not None:
            unit.navigator.see(scan, odometry)
        unit.step(moving.time)
        moving.step(self._asked)
        step = compose(inverse(before), moving.pose)
        length, turn = math.hypot(step[0], step[1]), abs(step[2])
        drift = self._random.normal(size=3) * (0.0, 0.0, self._wheels.drift * math.sqrt(length))
        self._believed = compose(self._believed, step * self._scales + drift)
        growth = self._wheels.growth
        self._covariance += np.diag(
            (growth.distance * length, growth.distance * length, growth.turn * turn)
        )
        self.way += length
        self.least = min(self.least, moving.gap(self.flat.boxes))

    def explore(self) -> None:
        """Explore, until nothing is left or it takes too long."""
        self.unit.explore()
        while self.unit.is_exploring and self.moving.time < LONGEST:
            self.step()

    def look(self) -> None:
        """Stand for a second, and look around."""
        for _ in range(round(RATE)):
            self.step()

    def close_doors(self) -> None:
        """Close all doors of the flat."""
        doors = np.array([closed(door) for door in self.flat.doors])
        boxes = np.concatenate((self.flat.boxes, doors))
        self.flat = dataclasses.replace(self.flat, boxes=boxes)

    def knows(self, place: np.ndarray) -> bool:
        """Whether somebody has looked at a place of the map, shape (2,) [m]."""
        grid = self.unit.navigator.locator.grid
        seen = grid.has(place) and grid.cells[tuple(grid.to_cells(place[None])[0])] != UNKNOWN
        return bool(seen)  # numpy's own cannot be written as JSON

    def go(self, goal: np.ndarray, patience: float = PATIENCE) -> dict[str, Any]:
        """Drive to a goal, given as the world has it; return how that went, by the truth."""
        self.least, until = math.inf, self.moving.time + patience
        begin, way, is_known = self.moving.time, self.way, self.knows(goal[:2])
        self.unit.go(goal)
        while self.unit.navigator.goal is not None and self.moving.time < until:
            self.step()
        off = self.moving.pose - goal
        return {
            'goal': goal.tolist(),
            'outcome': str(self.unit.navigator.outcome),
            'off': math.hypot(off[0], off[1]),
            'turned_off': abs(math.remainder(off[2], 2.0 * math.pi)),
            'gap': self.least,
            'way': self.way - way,
            'took': self.moving.time - begin,
            'known': is_known,
        }


def explore(name: str, seed: int) -> dict[str, Any]:
    """Let a robot explore a flat; return what of it is known then, and the way [m]."""
    ride = Ride(name, seed)
    ride.explore()
    unit, moving, inscribed = ride.unit, ride.moving, ride.course.robot.footprint.inscribed
    return {
        'seed': seed,
        'done': not unit.is_exploring,
        'known': _known(unit, ride.flat, inscribed),
        'way': ride.way,
        'tour': tour(ride.flat, inscribed),
        'home': math.hypot(moving.pose[0], moving.pose[1]),
        'gap': ride.least,
        'time': moving.time,
        'outcome': str(unit.navigator.outcome),
    }


def drive_explored(name: str, seed: int) -> list[dict[str, Any]]:
    """Let a robot explore a flat, and then drive to places that can be reached."""
    ride = Ride(name, seed)
    ride.explore()
    return [{'seed': seed, **ride.go(ride.course.choose_goal())} for _ in range(GOALS)]


def drive_unseen(name: str, seed: int) -> list[dict[str, Any]]:
    """Send a robot that knows nothing of a flat to places that can be reached."""
    ride = Ride(name, seed)
    ride.look()
    drives = []
    for number in range(UNSEEN):
        goal = ride.course.choose_goal(NEAREST if number else FAR)
        shortest = ride.course.shortest(goal)
        drives.append({'seed': seed, 'shortest': shortest, **ride.go(goal)})
        ride.unit.stop('the next goal comes')
    return drives


def drive_shut_off(name: str, seed: int) -> dict[str, Any]:
    """Send a robot that knows nothing of a flat to a place that cannot be reached."""
    ride = Ride(name, seed)
    goal, _, kind = ride.course.choose_shut_off()
    if kind == 'behind closed doors':
        ride.close_doors()
    ride.look()
    return {'seed': seed, 'kind': kind, **ride.go(goal, LONGEST_SEARCH)}


def _known(unit: RobotNavigator, flat: Any, inscribed: float) -> float:
    """Return the share of all places that can be driven to which the map has as free."""
    truth = draw_grid(flat.boxes, flat.corner, flat.size)
    distances = measure_distances(truth.cells == OCCUPIED, truth.resolution)
    distances[truth.cells == UNKNOWN] = -1.0
    reached = flood(truth.to_cells(np.zeros((1, 2)))[0], distances, inscribed + 0.03)
    points = truth.to_points(np.argwhere(reached))
    grid = unit.navigator.locator.grid
    cells = grid.to_cells(points)
    inside = grid.covers(cells)
    free = np.zeros(len(points), bool)
    found = grid.cells[tuple(cells[inside].T)]
    free[inside] = (found >= FREE) & (found < 65)
    return float(free.mean())


def tour(flat: Any, inscribed: float) -> float:
    """Return the way of a script that visits the middle of each room, the nearest first [m]."""
    truth = draw_grid(flat.boxes, flat.corner, flat.size)
    distances = measure_distances(truth.cells == OCCUPIED, truth.resolution)
    free = np.where(distances > inscribed + 0.03, 1.0, np.inf).astype(np.float32)
    places = [0.5 * (room[:2] + room[2:]) for room in flat.rooms]
    here, way = np.zeros(2), 0.0

    def lengths(place: np.ndarray) -> np.ndarray:
        return ways_from(truth.to_cells(place[None])[0], free, truth.resolution)

    goals = []
    for place in places:  # furniture may stand there
        cells = np.argwhere(np.isfinite(free))
        near = np.hypot(*(truth.to_points(cells) - place).T)
        goals.append(truth.to_points(cells[near.argmin()][None])[0])
    while goals:
        values = lengths(here)
        costs = [float(values[tuple(truth.to_cells(goal[None])[0])]) for goal in goals]
        index = int(np.argmin(costs))
        if costs[index] == np.inf:
            break
        way += costs[index]
        here = goals.pop(index)
    return way + float(lengths(here)[tuple(truth.to_cells(np.zeros((1, 2)))[0])])


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Let mbot explore flats."""
    note('explore: mbot')
    flats = 1 if quick else 20
    trials = all_on_cores(partial(explore, 'mbot'), range(FIRST_SEED, FIRST_SEED + flats))
    good = [
        trial['done'] and trial['known'] >= KNOWN and trial['gap'] > 0.0 and trial['home'] < 0.1
        for trial in trials
    ]
    longer = [trial['way'] / trial['tour'] for trial in trials]
    least = 100.0 * min(trial['known'] for trial in trials)
    return [
        Row(
            what='explore, mbot: flats nobody has seen, own map and pose, ideal lidar, no physics',
            measured=f'{format_count(sum(good), len(good))} back with all of it; {least:.1f} % of '
            f'what can be driven to known at least; way {np.median(longer):.2f} of a tour of the '
            f'rooms, at worst {max(longer):.2f}',
            must=f'all, >= {100.0 * KNOWN:g} %, <= {LONGER:g}',
            passed=all(good) and max(longer) <= LONGER,
            trials=trials,
        ),
        *_goals_by_own_map(flats, note),
        *_goals_unseen(flats, note),
    ]


def _goals_by_own_map(flats: int, note: Callable[[str], None]) -> list[Row]:
    rows = []
    for name in ROBOTS:
        note(f'explore: {name}, goals in flats that it explored')
        seeds = range(FIRST_SEED + 100, FIRST_SEED + 100 + flats)
        done = all_on_cores(partial(drive_explored, name), seeds)
        drives = [drive for drives in done for drive in drives]
        rows.append(_arrivals(name, drives))
    return rows


def _goals_unseen(flats: int, note: Callable[[str], None]) -> list[Row]:
    rows = []
    for name in ROBOTS:
        note(f'explore: {name}, goals while it maps')
        seeds = range(FIRST_SEED + 400, FIRST_SEED + 400 + flats)
        done = all_on_cores(partial(drive_unseen, name), seeds)
        drives = [drive for drives in done for drive in drives]
        there = _there(drives)
        fresh = [drive for drive in drives if not drive['known']]
        reached = [drive for drive in fresh if _there([drive])[0]]
        longer = [drive['way'] / drive['shortest'] for drive in reached] or [math.nan]
        touched = sum(drive['gap'] <= 0.0 for drive in drives)
        rows.append(
            Row(
                what=f'goals, {name}: while it maps flats nobody has seen, own map and pose, '
                'ideal lidar, no physics',
                measured=f'{format_count(sum(there), len(there))} there, of {len(fresh)} nobody '
                f'had looked at {sum(_there(fresh))}; {touched} touched; way of those '
                f'{np.median(longer):.2f} of the shortest, at worst {max(longer):.2f}',
                must=f'>= {100.0 * MOST:g} %, 0 touched',
                passed=sum(there) >= MOST * len(there) and touched == 0,
                trials=drives,
            )
        )
        tries = all_on_cores(partial(drive_shut_off, name), seeds)
        ended = [trial['outcome'].startswith(_GIVEN_UP) for trial in tries]
        touched = sum(trial['gap'] <= 0.0 for trial in tries)
        rows.append(
            Row(
                what=f'goals, {name}: while it maps, where no way leads',
                measured=f'{format_count(sum(ended), len(ended))} said so, slowest after '
                f'{max(trial["took"] for trial in tries):.0f} s; {touched} touched',
                must=f'all, <= {LONGEST_SEARCH:g} s: all of a flat may have to be looked at',
                passed=all(ended) and touched == 0,
                trials=tries,
            )
        )
    return rows


# How the outcome of a goal begins that was not reached.
_GIVEN_UP = ("Outcome(state='refused'", "Outcome(state='failed'")


def _there(drives: list[dict[str, Any]]) -> list[bool]:
    """Return which goals were reached without a touch, by the truth."""
    return [
        'arrived' in drive['outcome']
        and drive['off'] <= NEAR
        and drive['turned_off'] <= TURNED
        and drive['gap'] > 0.0
        for drive in drives
    ]


def _arrivals(name: str, drives: list[dict[str, Any]]) -> Row:
    there = _there(drives)
    off = 100.0 * max(
        (drive['off'] for drive in drives if 'arrived' in drive['outcome']), default=0.0
    )
    gap = 100.0 * min(drive['gap'] for drive in drives)
    return Row(
        what=f'goals, {name}: flats that it explored, own map and pose, ideal lidar, no physics',
        measured=f'{format_count(sum(there), len(there))} there without a touch, the farthest '
        f'{off:.1f} cm off; {gap:.1f} cm from obstacles at worst, by the truth',
        must=f'all, <= {100.0 * NEAR:g} cm',
        passed=all(there),
        trials=drives,
    )
