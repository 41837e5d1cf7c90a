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
# Where the second robot drives [m].
ROUND = (
    (2.0, -1.0, math.nan),
    (0.5, 2.0, math.nan),
    (-1.5, 0.5, math.nan),
    (-1.2, -1.0, math.nan),
)


def explore_room(name):
    """Explore a room with furniture, and save its map by a name."""
    run = Run(RunOptions(**OPTIONS, world='room', explore=True, save_map=name))
    unit = run.navigations[0].unit
    while not unit.is_exploring:
        run.simulation.advance(500)
    while unit.is_exploring and run.world.time < 240.0:
        run.simulation.advance(500)
    assert not unit.is_exploring
    run.close()


def middles(plan):
    """Return the middles of the occupied cells of a plan (n, 2) [m]."""
    rows, columns = np.nonzero(plan.cells == OCCUPIED)
    return (np.column_stack((columns, rows)) + 0.5) * plan.resolution + plan.origin


def distances(points, plan):
    """Return how far points (n, 2) are from the nearest occupied cell of a plan, in x or y [m]."""
    off = np.abs(points[:, None] - middles(plan)) - 0.5 * plan.resolution
    return np.maximum(off, 0.0).max(axis=2).min(axis=1)


@pytest.fixture(scope='module')
def saved(tmp_path_factory):
    """Return the map of a room with furniture, as it was saved."""
    name = tmp_path_factory.mktemp('plan') / 'first'
    explore_room(str(name))
    return name.with_suffix('.yaml')


def test_a_goal_is_driven_to_in_a_saved_map(saved):
    options = RunOptions(**OPTIONS, world=str(saved), goals=((1.5, -0.8, math.nan),))
    run = Run(options)
    navigation = run.navigations[0]
    while not navigation.report()['goals'] and run.world.time < 60.0:
        run.simulation.advance(500)
    (goal,) = navigation.report()['goals']
    assert goal['state'] == 'arrived'
    assert math.dist(goal['truth'][:2], (1.5, -0.8)) < 0.1
    run.close()


def test_the_map_of_that_world_is_the_map_that_it_was_made_of(saved):
    name = saved.with_name('second')
    # Not by exploring: behind the desk the first map knows no wall, and a way leads out there.
    run = Run(RunOptions(**OPTIONS, world=str(saved), goals=ROUND, save_map=str(name)))
    navigation = run.navigations[0]
    while len(navigation.report()['goals']) < len(ROUND) and run.world.time < 120.0:
        run.simulation.advance(500)
    assert [goal['state'] for goal in navigation.report()['goals']] == ['arrived'] * len(ROUND)
    run.close()
    first, second = read_plan(str(saved)), read_plan(f'{name}.yaml')
    points = middles(second) + find_start(first)  # where the second one began
    share = (distances(points, first) < first.resolution + 1e-6).mean()
    assert len(points) > 300
    assert share >= 0.98, share
