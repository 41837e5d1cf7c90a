# SPDX-License-Identifier: Apache-2.0
"""Ground that is not flat: as high as it says, where it says, the same for the same seed."""

import math

from cases import for_all
from descriptions import robot_named
import mujoco
from mujoco_sim.scene import (
    AHEAD,
    COURSE,
    COURSE_SPANS,
    EDGE,
    LANDING,
    PIT,
    STEPS,
    STONE,
    STONES,
    TREAD,
)
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_core.errors import SimulationError


@pytest.fixture(scope='module')
def go2():
    return robot_named('go2')


@pytest.fixture(scope='module')
def height(go2):
    """Return a function: the ground's height [m] of a world at x, y, with a seed."""
    worlds = {}

    def height(name, x, y=0.0, seed=0):
        if (name, seed) not in worlds:
            world = build_world(go2, name, seed)
            world.data.qpos[:3] = (-20.0, 0.0, 1.0)  # the robot out of the way
            mujoco.mj_forward(world.model, world.data)
            worlds[name, seed] = world
        world = worlds[name, seed]
        geom = np.zeros(1, np.int32)
        above = np.array((x, y, 5.0))
        distance = mujoco.mj_ray(
            world.model, world.data, above, np.array((0.0, 0.0, -1.0)), None, 1, -1, geom
        )
        return 5.0 - distance

    return height


WORLDS = ['slope:15', 'slope:-15', 'stairs:0.1', 'step:0.08', 'boxes:0.05', 'rough:0.05']
WORLDS += ['ice:0.2', 'gap:0.1', 'stepping:0.1', 'course:1', 'course:2']


@pytest.mark.slow
@for_all('world', WORLDS)
@for_all('x', [-1.0, -0.4, 0.0, 0.4, 0.75])
def test_the_robot_starts_on_a_plane(height, world, x):
    assert height(world, x) == pytest.approx(0.0, abs=2e-3)


@pytest.mark.slow
@for_all('degrees', [5.0, 15.0, 30.0, -5.0, -15.0, -30.0])
def test_a_slope_has_the_angle_it_says(height, degrees):
    tangent = math.tan(math.radians(degrees))
    for beyond in (0.3, 1.0, 3.0, 6.0):
        found = height(f'slope:{degrees}', AHEAD + beyond)
        assert found == pytest.approx(beyond * tangent, abs=1e-6)


def test_stairs_rise_by_what_they_say_at_every_tread(height):
    for step in range(STEPS):
        middle = AHEAD + (step + 0.5) * TREAD
        assert height('stairs:0.1', middle) == pytest.approx(0.1 * (step + 1), abs=1e-9)
    assert height('stairs:0.1', AHEAD + STEPS * TREAD + 2.0) == pytest.approx(0.6, abs=1e-9)


@pytest.mark.parametrize(('world', 'tread'), [('stairs:0.1', TREAD), ('stairs:0.1,0.25', 0.25)])
def test_stairs_go_down_again_behind_a_landing_as_they_went_up(height, world, tread):
    top = AHEAD + (STEPS - 1) * tread
    middle = top + LANDING / 2.0
    for way in (0.0, LANDING / 2.0 - 0.01):
        assert height(world, middle + way) == pytest.approx(0.6, abs=1e-9)
    for way in np.arange(0.05, middle, 0.0713):
        assert height(world, middle + way) == pytest.approx(height(world, middle - way), abs=1e-9)
    for step in range(STEPS):
        inside = AHEAD + (step + 0.5) * tread
        assert height(world, inside) == pytest.approx(0.1 * (step + 1), abs=1e-9)


def test_stones_lie_as_far_apart_as_they_say_and_are_level_with_the_floor(height):
    gap = 0.1
    places = np.arange(AHEAD + EDGE, AHEAD + STONES - EDGE, 0.005)
    heights = np.array([height('stepping:0.1', x) for x in places])
    assert set(np.round(heights, 9)) == {0.0, -PIT}
    share = float((heights == 0.0).mean())
    assert share == pytest.approx(STONE / (STONE + gap), abs=0.05)
    across = np.array(
        [height('stepping:0.1', float(places[heights == 0.0][0]), y) for y in (0.0, 0.175, 0.35)]
    )
    np.testing.assert_allclose(across, [0.0, -PIT, 0.0], atol=1e-9)
    assert height('stepping:0.1', AHEAD + STONES + 2.0 * EDGE) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(5))
def test_a_course_has_all_its_parts_within_their_spans_and_ends_level(height, seed):
    places = np.arange(AHEAD - 0.05, AHEAD + COURSE + 1.0, 0.01)
    heights = np.array([height(f'course:{seed}', x) for x in places])
    assert heights[0] == heights[-1] == pytest.approx(0.0, abs=1e-9)
    assert set(heights[places > AHEAD + COURSE]) == {0.0}
    least, most = COURSE_SPANS['gap']
    assert least - 0.02 <= 0.01 * (heights < -0.1).sum() <= most + 0.02
    assert 3 * COURSE_SPANS['stairs'][0] <= heights.max() <= 3 * COURSE_SPANS['stairs'][1] + 1e-9
    assert (heights >= -PIT - 1e-9).all()


@pytest.mark.slow
def test_courses_of_different_seeds_differ_and_the_run_s_own_seed_changes_none(height):
    places = np.arange(AHEAD, AHEAD + COURSE, 0.05)

    def profile(name, seed=0):
        return [height(name, x, seed=seed) for x in places]

    assert profile('course:1') == profile('course:1', seed=3)
    assert profile('course:1') != profile('course:2')


@pytest.mark.slow
def test_a_step_is_where_the_seed_says(height):
    edges = set()
    for seed in range(4):
        heights = [height('step:0.08', AHEAD + 0.01 * i, seed=seed) for i in range(-2, 40)]
        assert set(np.round(heights, 9)) == {0.0, 0.08}
        assert heights == sorted(heights)
        edges.add(heights.index(max(heights)))
    assert len(edges) > 1


def patch(height, world, seed=0):
    """Return heights of a grid of places ahead of the robot, shape (n, m)."""
    return np.array(
        [
            [height(world, x, y, seed) for y in np.arange(-1.8, 1.81, 0.09)]
            for x in np.arange(AHEAD + 1.2, AHEAD + 6.0, 0.13)
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['boxes', 'rough'])
def test_random_ground_is_as_high_as_it_says_and_no_higher(height, kind):
    found = patch(height, f'{kind}:0.05')
    assert found.min() >= -1e-9
    assert found.max() <= 0.05 + 1e-9
    assert found.max() > 0.035
    assert np.std(found) > 0.004


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['boxes', 'rough'])
def test_random_ground_is_the_seeds(height, kind):
    world = f'{kind}:0.05'
    first = patch(height, world, seed=1)
    assert (patch(height, world, seed=2) != first).any()


@pytest.mark.slow
def test_the_same_seed_builds_the_same_ground(go2):
    one, other = (build_world(go2, 'boxes:0.05', seed=3).model for _ in range(2))
    np.testing.assert_array_equal(one.geom_size, other.geom_size)


def test_rough_ground_has_no_edges(height):
    steps = np.abs(np.diff([height('rough:0.05', x) for x in np.arange(1.0, 8.0, 0.01)]))
    assert steps.max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize('world', ['boxes:0.05', 'stairs:0.1', 'slope:20'])
def test_a_robot_let_fall_on_it_stays_on_top(height, world):
    # Physics sees what rays see: a robot lands on the ground, not in it.
    landed = build_world(robot_named('go2'), world)
    landed.data.qpos[:3] = (2.0, 0.0, height(world, 2.0) + 0.3)
    landed.step(300)
    assert landed.base().position[2] > height(world, float(landed.base().position[0])) + 0.01


@for_all(
    'world',
    [
        'slope:60',
        'slope:',
        'slope:steep',
        'slope:nan',
        'boxes:0',
        'stairs:-0.1',
        'stairs:0.1,',
        'stairs:0.1,0.1',
        'stairs:,0.3',
        'stepping:0',
        'step:1',
        'ice:0',
        'course:-1',
    ],
)
def test_a_size_that_is_none_is_said(go2, world):
    with pytest.raises(SimulationError, match=f'--world {world}: wanted a number from'):
        build_world(go2, world)


def test_more_numbers_than_a_world_has_are_said(go2):
    with pytest.raises(SimulationError, match='stairs:0.1,0.3,2: wanted at most 2 numbers'):
        build_world(go2, 'stairs:0.1,0.3,2')
    with pytest.raises(SimulationError, match='gap:0.1,0.3: wanted one number'):
        build_world(go2, 'gap:0.1,0.3')


def test_a_course_is_of_a_whole_number(go2):
    with pytest.raises(SimulationError, match='course:1.5: wanted a whole number'):
        build_world(go2, 'course:1.5')
