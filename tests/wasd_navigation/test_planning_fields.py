# SPDX-License-Identifier: Apache-2.0
"""Distances to obstacles, what is left to a goal, footprints: against closed forms."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_navigation.parameters import Footprint, InvalidFootprint
from wasd_navigation.planning.distances import FARTHEST, Field, measure_distances
from wasd_navigation.planning.goal_field import follow, Spreading, WHOLE

RESOLUTION = 0.05


def cluttered() -> np.ndarray:
    random = np.random.default_rng(4)
    return np.asarray(random.random((70, 90)) < 0.004)


def test_distances_are_those_to_the_nearest_of_all_obstacles() -> None:
    occupied = cluttered()
    found = measure_distances(occupied, RESOLUTION)
    obstacles = np.argwhere(occupied)
    cells = np.argwhere(np.ones_like(occupied))
    apart = np.linalg.norm(cells[:, None] - obstacles[None], axis=2).min(axis=1)
    expected = (apart - 0.5) * RESOLUTION
    assert found.ravel() == pytest.approx(np.minimum(expected, FARTHEST), abs=1e-5)


def test_distances_end_where_nothing_is_looked_for() -> None:
    found = measure_distances(np.zeros((5, 7), bool), RESOLUTION)
    assert found == pytest.approx(np.full((5, 7), FARTHEST))


def spread(
    goal: tuple[int, int], price: np.ndarray, escape: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Return what is left to a goal's cell, and what none that is reached exceeds, at once."""
    escape = np.zeros_like(price, bool) if escape is None else escape
    spreading = Spreading(goal, price, escape, RESOLUTION)
    assert spreading.work(WHOLE)
    return spreading.values, spreading.beyond


def test_in_the_open_what_is_left_is_the_straight_distance() -> None:
    price = np.ones((120, 120), np.float32)
    values, _ = spread((60, 60), price)
    rows, columns = np.mgrid[:120, :120]
    straight = np.hypot(rows - 60, columns - 60) * RESOLUTION
    assert np.abs(values - straight).max() <= 0.015 * straight.max()


def test_around_a_wall_what_is_left_is_the_way_by_its_end() -> None:
    price = np.ones((100, 100), np.float32)
    price[50, :80] = np.inf
    values, _ = spread((30, 40), price)
    corner = np.array((50, 80))
    way = np.linalg.norm(corner - (30, 40)) + np.linalg.norm(corner - (70, 40))
    assert values[70, 40] == pytest.approx(way * RESOLUTION, rel=0.04)
    field = Field(values[None], 0.0, 0.0, RESOLUTION)
    room = np.empty((4000, 2))
    count = follow(field, 0, np.array((40, 70)) * RESOLUTION, room)
    steps = np.linalg.norm(np.diff(room[:count], axis=0), axis=1)
    assert steps.sum() == pytest.approx(way * RESOLUTION, rel=0.04)
    assert math.dist(room[count - 1], (40 * RESOLUTION, 30 * RESOLUTION)) < RESOLUTION


def test_nothing_is_left_from_where_no_way_leads() -> None:
    price = np.ones((40, 40), np.float32)
    price[20] = np.inf
    values, beyond = spread((5, 5), price)
    assert (values[21:] == beyond).all()
    assert (values[:20] < beyond).all()


def test_one_finds_out_of_where_nobody_may_be_but_not_through() -> None:
    price = np.ones((40, 40), np.float32)
    price[20:24] = np.inf
    escape = np.zeros_like(price, bool)
    escape[20:24] = True
    values, beyond = spread((5, 5), price, escape)
    assert (values[20:24] < beyond).all()
    assert (np.diff(values[18:24], axis=0) > 0.0).all()
    assert (values[24:] == beyond).all()


def test_what_is_left_is_the_same_in_slices_as_at_once() -> None:
    random = np.random.default_rng(7)
    price = np.where(cluttered(), np.inf, random.uniform(1.0, 3.0, (70, 90))).astype(np.float32)
    price[30:36] = np.inf
    escape = np.zeros_like(price, bool)
    escape[30:33] = True
    whole, beyond = spread((5, 5), price, escape)
    slices = Spreading((5, 5), price, escape, RESOLUTION)
    count = 1
    while not slices.work(500):
        count += 1
    assert count >= 30 * 90 // 500  # at least all cells on this side
    assert (slices.values == whole).all()
    assert slices.beyond == beyond


@for_all('footprint', [Footprint(half_length=0.35, half_width=0.155), Footprint(radius=0.2)])
def test_circles_cover_the_edge_of_a_footprint_and_little_more(footprint: Footprint) -> None:
    circles = footprint.circles
    if footprint.is_circle:
        turn = np.linspace(0.0, 2.0 * math.pi, 200)
        edge = footprint.radius * np.stack((np.cos(turn), np.sin(turn)), axis=1)
    else:
        half = np.array((footprint.half_length, footprint.half_width))
        share = np.linspace(-1.0, 1.0, 200)
        sides = [np.stack((share, np.full_like(share, side)), axis=1) for side in (-1.0, 1.0)]
        edge = np.concatenate([side[:, ::flip] * half for side in sides for flip in (1, -1)])
    apart = np.linalg.norm(edge[:, None] - circles[None, :, :2], axis=2) - circles[:, 2]
    assert apart.min(axis=1).max() <= 1e-9
    outermost = np.abs(circles[:, :2]) + circles[:, 2:]
    sizes = (footprint.radius,) * 2 if footprint.is_circle else half
    assert (outermost <= np.array(sizes) + 0.035).all()


@for_all('sizes', [{}, {'radius': 0.2, 'half_length': 0.3, 'half_width': 0.1}])
def test_a_footprint_that_is_neither_or_both_is_refused(sizes: dict[str, float]) -> None:
    with pytest.raises(InvalidFootprint, match='a circle with a radius'):
        Footprint(**sizes)
