# SPDX-License-Identifier: Apache-2.0
"""
Exploring of flats that nobody has seen, by a robot's own map and pose; without physics.

The lidar is the ideal one (1 cm of noise), odometry errs as each robot's does.
"""

from collections.abc import Callable
import math
from typing import Any

from kinematic import draw_grid, KinematicRobot, ROBOTS
from mujoco_sim.flats import make_flat
import numpy as np
from slam_logs import ODOMETRIES
from table import format_count, Row
from wasd_core.rotations import Pose
from wasd_navigation.odometry import Odometry
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import flood, march_from
from wasd_navigation.records import FREE, OCCUPIED, UNKNOWN
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose, inverse

FIRST_SEED = 7000
LONGEST = 900.0  # [s]
KNOWN, LONGER = 0.98, 1.5
LEVEL = Pose(np.zeros(3), np.eye(3))


def explore(name: str, seed: int) -> dict[str, Any]:
    """Let a robot explore a flat; return what of it is known then, and the way [m]."""
    robot, flat = ROBOTS[name], make_flat(seed)
    moving = KinematicRobot(robot, np.zeros(3), seed)
    limits = {f'limits.{key}': value for key, value in vars(robot.limits).items()}
    planning = {f'planning.{key}': value for key, value in vars(robot.parameters).items()}
    footprint = robot.footprint
    size = (
        {'robot_radius': footprint.radius}
        if footprint.is_circle
        else {
            'footprint_length': 2.0 * footprint.half_length,
            'footprint_width': 2.0 * footprint.half_width,
        }
    )
    unit = RobotNavigator(NavigatorParameters().changed({**limits, **planning, **size}))
    asked = [np.zeros(3)]
    unit.send = lambda velocity: asked.__setitem__(0, velocity)
    wheels = ODOMETRIES[name]
    random = np.random.default_rng((seed, 71))
    scale, turn_scale = 1.0 + random.normal(size=2) * (wheels.scale, wheels.turn_scale)
    believed, covariance = np.zeros(3), 1e-6 * np.eye(3)
    unit.explore()
    way, least, before = 0.0, math.inf, moving.pose
    while unit.is_exploring and moving.time < LONGEST:
        odometry = Odometry(believed, moving.velocity, covariance.copy(), LEVEL)
        unit.navigator.move(odometry)
        scan = moving.scan(flat.boxes)
        if scan is not None:
            unit.navigator.see(scan, odometry)
        unit.step(moving.time)
        moving.step(asked[0])
        step = compose(inverse(before), moving.pose)
        length, turn = math.hypot(step[0], step[1]), abs(step[2])
        noise = random.normal(size=3) * (0.0, 0.0, wheels.drift * math.sqrt(length))
        believed = compose(believed, step * (scale, scale, turn_scale) + noise)
        growth = wheels.growth
        covariance += np.diag(
            (growth.distance * length, growth.distance * length, growth.turn * turn)
        )
        way, before = way + length, moving.pose
        least = min(least, moving.gap(flat.boxes))
    return {
        'seed': seed,
        'done': not unit.is_exploring,
        'known': _known(unit, flat, footprint.inscribed),
        'way': way,
        'tour': tour(flat, footprint.inscribed),
        'home': math.hypot(moving.pose[0], moving.pose[1]),
        'gap': least,
        'time': moving.time,
        'outcome': str(unit.navigator.outcome),
    }


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
    nothing = np.zeros(free.shape, bool)

    def lengths(place: np.ndarray) -> tuple[np.ndarray, float]:
        row, column = map(int, truth.to_cells(place[None])[0])
        return march_from((row, column), free, nothing, truth.resolution)

    goals = []
    for place in places:  # furniture may stand there
        cells = np.argwhere(np.isfinite(free))
        near = np.hypot(*(truth.to_points(cells) - place).T)
        goals.append(truth.to_points(cells[near.argmin()][None])[0])
    while goals:
        values, beyond = lengths(here)
        costs = [float(values[tuple(truth.to_cells(goal[None])[0])]) for goal in goals]
        index = int(np.argmin(costs))
        if costs[index] >= beyond:
            break
        way += costs[index]
        here = goals.pop(index)
    values, _ = lengths(here)
    return way + float(values[tuple(truth.to_cells(np.zeros((1, 2)))[0])])


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Let mbot explore flats."""
    note('explore: mbot')
    trials = [explore('mbot', FIRST_SEED + index) for index in range(1 if quick else 20)]
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
        )
    ]
