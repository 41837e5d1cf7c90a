# SPDX-License-Identifier: Apache-2.0
"""People who come to where all was free tell nothing of where the robot is."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_navigation.mapping.comers import Comers
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.records import OCCUPIED, Scan

RAYS = np.linspace(-math.pi, math.pi, 360, endpoint=False)
# A corridor of 2 m along x whose ends no ray reaches; steps and sight [m].
HALF, SIGHT, STEP = 1.0, 5.0, 0.08
LIKE_WHEELS = np.diag((2.5e-5, 2.5e-5, 1e-5))  # by so much covariance grows, a metre


def look(x: float, random: np.random.Generator, person: float | None = None) -> Scan:
    """Return what a lidar with a noise of 1 cm sees in the corridor, and of somebody at x [m]."""
    cos, sin = np.cos(RAYS), np.sin(RAYS)
    sin = np.where(sin == 0.0, 1e-9, sin)
    ranges = HALF / np.abs(sin)
    if person is not None:
        cos = np.where(cos == 0.0, 1e-9, cos)
        low = np.array((person - x - 0.12, -0.22))[:, None] / (cos, sin)
        high = np.array((person - x + 0.12, 0.22))[:, None] / (cos, sin)
        near, far = np.minimum(low, high).max(axis=0), np.maximum(low, high).min(axis=0)
        ranges = np.where((near < far) & (near > 0.0), np.minimum(near, ranges), ranges)
    hits = ranges < SIGHT
    ranges = np.where(hits, ranges + 0.01 * random.normal(size=len(RAYS)), SIGHT)
    return Scan(np.zeros(2), np.stack((ranges * cos, ranges * sin), axis=1), hits)


class Drive:
    """A robot in the corridor whose odometry is right, and says that it errs as wheels do."""

    def __init__(self) -> None:
        self.mapper, self.x, self._way = Mapper(), 0.0, 0.0
        self._random = np.random.default_rng(4)

    def step(self, move: float, person: float | None = None) -> float:
        """Move along the corridor [m]; return how far off the mapper has it."""
        self.x += move
        self._way += abs(move)
        pose = np.array((self.x, 0.0, 0.0))
        self.mapper.step(look(self.x, self._random, person), pose, self._way * LIKE_WHEELS)
        return abs(float(self.mapper.pose[0]) - self.x)

    def go(self, way: float) -> None:
        """Drive so far alone [m]."""
        for _ in range(round(abs(way) / STEP)):
            self.step(math.copysign(STEP, way))


@for_all('speed', [0.7, 1.0, 1.5])
def test_somebody_who_walks_ahead_in_a_corridor_does_not_pull_the_pose_along(speed):
    drive = Drive()
    drive.go(8.0)
    drive.go(-8.0)
    begin, far = drive.x + 1.5, 0.0
    for count in range(70):
        far = max(far, drive.step(STEP, begin + count * speed * STEP))
    assert far < 0.03


def is_drawn(mapper: Mapper, x: float) -> bool:
    """Whether the map has something in the middle of the corridor at x [m]."""
    row, column = mapper.grid.to_cells(np.array([[x - 0.12, 0.0]]))[0]
    return bool((mapper.grid.cells[row - 1 : row + 2, column - 1 : column + 2] == OCCUPIED).any())


def test_who_walks_past_is_not_drawn_and_who_stays_is():
    drive = Drive()
    drive.go(4.0)
    drive.go(-4.0)
    for count in range(20):
        drive.step(0.0, 1.0 + 0.1 * count)
        assert not any(is_drawn(drive.mapper, x) for x in np.arange(1.0, 3.0, 0.1))
    for _ in range(90):
        drive.step(0.0, 3.0)
    assert is_drawn(drive.mapper, 3.0)


def test_who_walks_out_of_the_open_to_a_wall_is_left_out_wholly_and_the_wall_is_not():
    odds = np.full((60, 60), -3.0, np.float32)  # all is free below a wall at y = 2.0 m
    odds[40:] = 3.0
    front = np.arange(-0.22, 0.23, 0.04)
    wall = np.stack((np.arange(0.5, 1.0, 0.1), np.full(5, 2.02)), axis=1)
    comers = Comers()
    for y in np.arange(1.0, 1.7, 0.16):  # in the open at first
        him = np.stack((np.full(len(front), 1.5), y + front), axis=1)
        ends = np.concatenate((him, wall))
        scan = Scan(np.zeros(2), ends, np.ones(len(ends), bool))
        left = comers.leave_out(scan, np.zeros(3), odds, (0.05, 0, 0))
        assert left.ends == pytest.approx(wall)
