# SPDX-License-Identifier: Apache-2.0
"""What a robot has mapped is a world that a robot drives in, and maps as it is."""

import math

from mujoco_sim.floor_plan import find_start
import numpy as np
import pytest
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.map_picture import OCCUPIED, read_plan

pytestmark = [pytest.mark.slow, pytest.mark.takes_up_to(400.0)]

OPTIONS = {'robot': 'mbot', 'description': 'mbot', 'preset': 'mbot', 'speed': 0.0, 'map': ''}
# Where both robots drive [m].
ROUND = ((1.5, -0.5, math.nan),)


def drive_round(name, world):
    """Drive round in a world, and save its map by a name; return what became of the goals."""
    run = Run(RunOptions(**OPTIONS, world=world, goals=ROUND, save_map=str(name)))
    navigation = run.navigations[0]
    while len(navigation.report()['goals']) < len(ROUND) and run.world.time < 120.0:
        run.simulation.advance(500)
    goals = navigation.report()['goals']
    run.close()
    return goals


def middles(plan):
    """Return the middles of the occupied cells of a plan (n, 2) [m]."""
    rows, columns = np.nonzero(plan.cells == OCCUPIED)
    return (np.column_stack((columns, rows)) + 0.5) * plan.resolution + plan.origin


def distances(points, plan):
    """Return how far points (n, 2) are from the nearest occupied cell of a plan, in x or y [m]."""
    off = np.abs(points[:, None] - middles(plan)) - 0.5 * plan.resolution
    return np.maximum(off, 0.0).max(axis=2).min(axis=1)


def test_the_map_of_that_world_is_the_map_that_it_was_made_of(tmp_path):
    saved = tmp_path / 'first.yaml'
    drive_round(tmp_path / 'first', 'room')
    goals = drive_round(tmp_path / 'second', str(saved))
    assert [goal['state'] for goal in goals] == ['arrived'] * len(ROUND)
    for goal, place in zip(goals, ROUND, strict=True):
        assert math.dist(goal['truth'][:2], place[:2]) < 0.1
    first, second = read_plan(str(saved)), read_plan(str(tmp_path / 'second.yaml'))
    points = middles(second) + find_start(first)  # where the second one began
    share = (distances(points, first) < first.resolution + 1e-6).mean()
    assert len(points) > 300
    assert share >= 0.98, share
