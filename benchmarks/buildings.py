# SPDX-License-Identifier: Apache-2.0
"""Large buildings: rooms of 5 m with doors, on a known map; how long a step takes there."""

from collections.abc import Sequence
import itertools
import math
import time
from typing import Any

from kinematic import KinematicRobot, RATE, RESOLUTION, ROBOTS
import numpy as np
from table import Row
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.parts import warm_up
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.goal_field import flood
from wasd_navigation.records import FREE, Grid, OCCUPIED

FIRST_SEED = 6000
ROOM, DOOR, WALL = 5.0, 1.0, 0.1  # [m]
SIZE = 100.0  # [m]
# A drive is looked at for so long [s]; it has begun once it has moved so far [m].
LOOKED_AT, BEGUN = 40.0, 0.05
LONGEST_STEP, SOON = 25.0, 3.0  # [ms], [s]


def joined_building(size: float, seed: int, reach: float) -> tuple[np.ndarray, Grid]:
    """Return a building, and its map, with a way for a robot of a reach [m] across it."""
    corner = 0.5 * (size - ROOM)
    for attempt in itertools.count():
        boxes = building(size, (seed, 61, attempt))
        grid = draw(boxes, size)
        start, goal = grid.to_cells(np.array(((-corner, -corner), (corner, corner))))
        distances = measure_distances(grid.cells == OCCUPIED, grid.resolution)
        if flood(start, distances, reach)[tuple(goal)]:
            break
    return boxes, grid


def building(size: float, seed: Sequence[int]) -> np.ndarray:
    """Return the walls of a square building around the origin, as boxes (n, 6)."""
    random = np.random.default_rng(seed)
    count = round(size / ROOM)
    boxes = []
    for line in range(count + 1):
        for part in range(count):
            low = -0.5 * size + part * ROOM
            at = -0.5 * size + line * ROOM
            is_open = 0 < line < count and random.random() < 0.8
            if not is_open:
                spans = [(low, low + ROOM)]
            else:
                door = low + float(random.uniform(0.3, ROOM - DOOR - 0.3))
                spans = [(low, door), (door + DOOR, low + ROOM)]
            for is_upright in (True, False):
                for begin, end in spans:
                    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
                    place = (at, middle) if is_upright else (middle, at)
                    halves = (0.5 * WALL, half) if is_upright else (half, 0.5 * WALL)
                    boxes.append((*place, *halves, 0.7, 0.0))
    return np.array(boxes)


def draw(boxes: np.ndarray, size: float) -> Grid:
    """Return the map of a building: its walls, which lie along the axes, are obstacles."""
    half = 0.5 * size + 2.0 * WALL
    count = round(2.0 * half / RESOLUTION)
    grid = Grid(np.full((count, count), FREE, np.int8), RESOLUTION, (-half, -half))
    for box in boxes:
        corners = np.array((box[:2] - box[2:4], box[:2] + box[2:4]))
        (row, column), (to_row, to_column) = grid.to_cells(corners + (1e-6, -1e-6))
        grid.cells[row : to_row + 1, column : to_column + 1] = OCCUPIED
    return grid


def cross(name: str, size: float, seed: int) -> dict[str, Any]:
    """Send a robot across a building; return how long its steps took [ms], when it began [s]."""
    robot = ROBOTS[name]
    boxes, grid = joined_building(size, seed, robot.footprint.inscribed + 0.05)
    start = np.array((-0.5 * size + 0.5 * ROOM, -0.5 * size + 0.5 * ROOM, 0.0))
    moving = KinematicRobot(robot, start, seed)
    driver = Driver(robot.limits, robot.footprint, robot.parameters)
    warm_up(Mapper(), driver)
    driver.set_goal(np.array((0.5 * size - 0.5 * ROOM, 0.5 * size - 0.5 * ROOM, 0.0)))
    steps, began, least = [], math.inf, math.inf
    while driver.is_under_way and moving.time < LOOKED_AT:
        near = boxes[np.abs(boxes[:, :2] - moving.pose[:2]).max(axis=1) < 20.0]
        scan = moving.scan(near)
        at = time.thread_time()
        asked = driver.step(grid, 0, moving.seen_pose(), moving.seen_velocity(), scan, 1.0 / RATE)
        steps.append(1e3 * (time.thread_time() - at))
        moving.step(asked)
        least = min(least, moving.gap(near))
        if math.dist(moving.pose[:2], start[:2]) > BEGUN:
            began = min(began, moving.time)
    way = math.dist(moving.pose[:2], start[:2])
    return {
        'seed': seed,
        'state': driver.state,
        'reason': driver.reason,
        'began': began,
        'way': way,
        'gap': least,
        'steps': steps,
    }


def measure_step(name: str, tries: int) -> Row:
    """Send a robot across large buildings; return how long its longest step takes."""
    trials = [cross(name, SIZE, FIRST_SEED + index) for index in range(tries)]
    steps = np.concatenate([trial.pop('steps') for trial in trials])
    began = max(trial['began'] for trial in trials)
    touched = sum(trial['gap'] <= 0.0 for trial in trials)
    return Row(
        what=f'goals, {name}: CPU time of a step in {SIZE:g} x {SIZE:g} m of rooms, known map',
        measured=f'median {np.median(steps):.2f} ms, p99 {np.percentile(steps, 99):.1f} ms, '
        f'longest {steps.max():.1f} ms; drives {began:.1f} s after the goal at the latest, '
        f'{touched} of {tries} touch',
        must=f'<= {LONGEST_STEP:g} ms, drives within {SOON:g} s',
        passed=float(steps.max()) <= LONGEST_STEP and began <= SOON and not touched,
        trials=trials,
    )
