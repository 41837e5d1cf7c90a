# SPDX-License-Identifier: Apache-2.0
"""Gaps hardly wider than a robot: what it drives into, it has to drive out of."""

import math
from typing import Any

from kinematic import draw_grid, KinematicRobot, RATE, ROBOTS
import numpy as np
from table import format_count, Row
from wasd_navigation.planning.driver import Driver

FIRST_SEED = 5000
# A gap is so deep, and so much wider than the robot on each side [m]; how long a drive takes [s].
DEEP, ROOM, LONGEST = (0.3, 1.5), (0.02, 0.16), 90.0


def gap_world(name: str, seed: int) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return a room with a gap across it, as boxes (n, 6), its middle with yaw, width, depth."""
    random = np.random.default_rng((seed, 51))
    inscribed = ROBOTS[name].footprint.inscribed
    width, depth = 2.0 * (inscribed + random.uniform(*ROOM)), random.uniform(*DEEP)
    yaw = random.uniform(-0.5 * math.pi, 0.5 * math.pi)
    middle = random.uniform(-0.05, 0.05, size=2)
    along, across = (
        np.array((math.cos(yaw), math.sin(yaw))),
        np.array((-math.sin(yaw), math.cos(yaw))),
    )
    boxes = []
    for side in (-1.0, 1.0):
        half = 1.5
        place = middle + side * (0.5 * width + half) * across
        boxes.append((*place, 0.5 * depth, half, 0.7, yaw))
        boxes.append((*(middle + side * (1.6 + 0.5 * depth) * along), 0.05, 3.2, 0.7, yaw))
    for side in (-1.0, 1.0):
        boxes.append((*(middle + side * 3.0 * across), 3.0, 0.05, 0.7, yaw))
    return np.array(boxes), np.array((*middle, yaw)), width, depth


def enter_and_leave(name: str, seed: int) -> dict[str, Any]:
    """
    Send a robot into a gap, and where its middle got in, out of it again on a random side.

    A robot that stands before the gap is sent nowhere else.
    """
    boxes, middle, width, depth = gap_world(name, seed)
    random = np.random.default_rng((seed, 52))
    robot = ROBOTS[name]
    grid = draw_grid(boxes, np.array((-4.5, -4.5)), np.array((9.0, 9.0)))
    ahead = np.array((math.cos(middle[2]), math.sin(middle[2]), 0.0))
    moving = KinematicRobot(robot, middle - (0.5 * depth + 0.8) * ahead, seed)
    driver = Driver(robot.limits, robot.footprint, robot.parameters)
    trial: dict[str, Any] = {'seed': seed, 'width': width}
    turned = float(random.choice((0.0, math.pi)))
    side, turn = random.choice((-1.0, 1.0)), random.uniform(-3.0, 3.0)
    goals = {
        'in': middle + (*(random.uniform(-0.1, 0.1) * ahead[:2]), turned),
        'out': middle + side * (0.5 * depth + 0.8) * ahead + (0.0, 0.0, turn),
    }
    least = math.inf
    for name_of, goal in goals.items():
        driver.set_goal(goal)
        begin = moving.time
        while driver.is_under_way and moving.time - begin < LONGEST:
            asked = driver.step(
                grid, 0, moving.seen_pose(), moving.seen_velocity(), moving.scan(boxes), 1.0 / RATE
            )
            moving.step(asked)
            least = min(least, moving.gap(boxes))
        trial[name_of], trial[f'{name_of}_reason'] = driver.state, driver.reason
        if name_of == 'in':
            # It may also arrive "as near as possible", before the gap.
            trial['is_inside'] = abs(float((moving.pose - middle) @ ahead)) < 0.5 * depth
            if not trial['is_inside']:
                break
    return {**trial, 'gap': least}


def leave_gaps(name: str, entered: int) -> Row:
    """Send a robot into gaps until it got into so many; see whether it leaves them all."""
    trials: list[dict[str, Any]] = []
    seed = FIRST_SEED
    while sum(trial['is_inside'] for trial in trials) < entered:
        trials.append(enter_and_leave(name, seed))
        seed += 1
    inside = [trial for trial in trials if trial['is_inside']]
    left = sum(trial['out'] == 'arrived' for trial in inside)
    stuck = sum(trial['in'] != 'refused' for trial in trials) - len(inside)
    touched = sum(trial['gap'] <= 0.0 for trial in trials)
    narrowest = 100.0 * min(trial['width'] for trial in inside)
    return Row(
        what=f'goals, {name}: a gap that was entered is left, {_range(name)} wide',
        measured=f'{format_count(left, len(inside))}, the narrowest {narrowest:.0f} cm; '
        f'{len(trials) - len(inside) - stuck} refused, {stuck} gave up outside, {touched} touched',
        must='all, 0 touched',
        passed=left == len(inside) and not touched,
        trials=trials,
    )


def _range(name: str) -> str:
    inscribed = ROBOTS[name].footprint.inscribed
    narrow, wide = (200.0 * (inscribed + room) for room in ROOM)
    return f'{narrow:.0f} to {wide:.0f} cm'
