# SPDX-License-Identifier: Apache-2.0
"""What a grid says against a scan: what is free, and walls between; never what nobody knows."""

import numpy as np
import pytest
from wasd_navigation.mapping.contradictions import Contradictions
from wasd_navigation.mapping.grid_surfaces import make_grid_map
from wasd_navigation.records import FREE, Grid, OCCUPIED, UNKNOWN

# A room of 4 x 4 m around the origin, in 6 x 6 m of which nothing else is known.
CELL, HALF, AROUND = 0.05, 2.0, 3.0
NOWHERE, HERE = np.zeros(2), np.zeros(3)


@pytest.fixture(params=[0.0, 0.013], ids=['on cells', 'between cells'])
def room(request) -> Grid:
    count = round(2.0 * AROUND / CELL)
    cells = np.full((count, count), UNKNOWN, np.int8)
    low, high = round((AROUND - HALF) / CELL), round((AROUND + HALF) / CELL)
    cells[low - 1 : high + 1, low - 1 : high + 1] = OCCUPIED
    cells[low:high, low:high] = FREE
    return Grid(cells, CELL, (-AROUND + request.param, -AROUND))


def share(grid: Grid, *places: tuple[float, float], pose: np.ndarray = HERE) -> float:
    """Return how much of points that face the lidar is contradicted from a pose."""
    points = np.array(places)
    facing = -points / np.hypot(*points.T)[:, None]
    surface = np.column_stack((points, facing, np.full(len(points), 0.01)))
    return Contradictions(grid, make_grid_map(grid), 0.02).share(surface, NOWHERE, pose)


def test_what_is_on_a_wall_is_not_contradicted(room):
    assert share(room, *((2.02, y) for y in np.arange(-1.0, 1.0, 0.1))) == 0.0


def test_what_is_in_the_middle_of_the_room_is_contradicted(room):
    assert share(room, (1.0, 0.0), (-1.2, 0.3)) == 1.0


def test_what_is_behind_a_wall_is_contradicted(room):
    assert share(room, (2.8, 0.0), (0.5, 2.9)) == 1.0


def test_what_is_where_nothing_is_known_is_not_contradicted(room):
    right = room.cells[:, round((AROUND + HALF) / CELL) :]
    right[right == OCCUPIED] = UNKNOWN
    assert share(room, (2.0, 0.0), (2.8, 0.4)) == 0.0


def test_a_pose_counts_with_its_heading(room):
    assert share(room, (2.02, 0.3), pose=np.array((0.0, 0.0, np.pi))) == 0.0
    assert share(room, (2.02, 0.3), pose=np.array((-1.0, 0.0, 0.0))) == 1.0
