# SPDX-License-Identifier: Apache-2.0
"""What mapping is made of: growth of odometry's covariance, canvas, drawing anew, search."""

import math

from cases import for_all
from lidar_room import circle, look
import numpy as np
import pytest
from wasd_navigation.mapping.grid_surfaces import make_grid_map
from wasd_navigation.mapping.local_map import (
    add_surfaces,
    count_fitting,
    Fit,
    fit_scan,
    make_local_map,
)
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.mapping.occupancy import Canvas
from wasd_navigation.mapping.places import Drawing, Places
from wasd_navigation.mapping.search import Pyramid, Search, Window
from wasd_navigation.mapping.surface import find_surface, Noise, RangeNoise
from wasd_navigation.odometry import add_covariance, OdometryGrowth
from wasd_navigation.records import Grid, Scan
from wasd_navigation.se2 import compose, inverse, is_definite, transform

NOISE = Noise(0.012, 0.0)
NOTHING = Scan(np.zeros(2), np.zeros((0, 2)), np.zeros(0, dtype=np.bool_))


def test_what_a_covariance_has_grown_by_is_found() -> None:
    growth, pose = OdometryGrowth(), np.array((1.0, 2.0, 0.7))
    before = np.array(((0.02, 0.003, 0.001), (0.003, 0.03, -0.002), (0.001, -0.002, 0.01)))
    move, added = np.array((0.3, 0.05, 0.2)), np.diag((1e-3, 2e-3, 3e-3))
    growth.step(pose, before)
    after = add_covariance(before, pose, move, added)
    found_move, found = growth.step(compose(pose, move), after)
    assert found_move == pytest.approx(move)
    assert found == pytest.approx(added, abs=1e-6)


@for_all('scale', [1.0, 0.5])
def test_a_covariance_that_does_not_grow_leaves_a_little(scale: float) -> None:
    growth, known = OdometryGrowth(), np.diag((0.01, 0.01, 0.02))
    growth.step(np.zeros(3), known)
    _, found = growth.step(np.array((1.0, 0.0, 0.0)), scale * known)
    assert (np.linalg.eigvalsh(found) > 0.0).all()
    assert np.abs(found).max() < 1e-4


def test_walls_face_the_lidar() -> None:
    scan = look(np.zeros(3), np.random.default_rng(0))
    points = find_surface(scan, NOISE).points
    assert len(points) > 0.9 * len(scan.ends)
    assert np.hypot(*points[:, 2:4].T) == pytest.approx(np.ones(len(points)))
    assert (np.einsum('ij,ij->i', points[:, :2], points[:, 2:4]) < 0.0).all()
    ahead = points[(points[:, 0] > 2.9) & (np.abs(points[:, 1]) < 0.8)]
    assert np.median(ahead[:, 2]) == pytest.approx(-1.0, abs=0.01)


def look_at_legs(pose: np.ndarray, legs: np.ndarray, random: np.random.Generator) -> Scan:
    """Return what an A1 sees of round legs, 5 cm across, in an empty hall, shape (n, 2)."""
    angles = np.radians(np.arange(-180.0, 180.0))
    ranges = np.full(360, np.inf)
    for x, y in transform(inverse(pose), legs):
        aside = np.abs(-np.sin(angles) * x + np.cos(angles) * y)
        along = np.cos(angles) * x + np.sin(angles) * y
        seen = (aside < 0.025) & (along > 0.0)
        deep = np.sqrt(np.maximum(0.025**2 - aside**2, 0.0))
        ranges[seen] = np.minimum(ranges[seen], (along - deep)[seen])
    hits = ranges < 6.0
    ranges = np.where(hits, ranges, 6.0) * (1.0 + 0.01 * hits * random.normal(size=360))
    return Scan(np.zeros(2), rays(angles, ranges), hits)


LEGS = np.array(((1.5, 0.4), (1.2, -1.6), (-1.4, 1.0), (-1.8, -0.9), (0.3, 2.1)))


def test_the_legs_of_a_table_are_points_that_face_nowhere() -> None:
    noise, random = Noise(0.012, 0.01), np.random.default_rng(12)
    points = find_surface(look_at_legs(np.zeros(3), LEGS, random), noise).points
    posts = points[(points[:, 2] == 0.0) & (points[:, 3] == 0.0)]
    assert len(posts) == len(LEGS)
    away = np.hypot(*(posts[:, None, :2] - LEGS[None]).T)
    assert away.min(axis=0).max() < 0.07  # thrice the deviation of a range


def test_a_wall_at_the_end_of_sight_tells_nothing() -> None:
    """Of a wall that is 5.98 m away those rays come back that noise has shortened."""
    angles = np.radians(np.arange(-20.0, 21.0))
    ranges = 5.98 / np.cos(angles) * (1.0 + 0.01 * np.random.default_rng(14).normal(size=41))
    hits = ranges < 6.0
    assert 3 < hits.sum() < 25
    noise = Noise(0.012, 0.01)
    scan = Scan(np.zeros(2), rays(angles, np.where(hits, ranges, 6.0)), hits)
    assert len(find_surface(scan, noise).points) == 0
    near = Scan(np.zeros(2), rays(angles, 0.75 * ranges), np.ones(41, dtype=np.bool_))
    assert len(find_surface(near, noise).points) > 30


def test_a_wall_has_no_legs() -> None:
    points = find_surface(look(np.zeros(3), np.random.default_rng(0)), NOISE).points
    assert np.hypot(*points[:, 2:4].T).min() > 0.9


def test_legs_alone_tell_where_a_robot_is() -> None:
    noise, random = Noise(0.012, 0.01), np.random.default_rng(13)
    local, places = make_local_map(8.0), Places()
    for _ in range(10):
        scan = look_at_legs(np.zeros(3), LEGS, random)
        places.add(scan, find_surface(scan, noise), np.zeros(3))
    places.show(local, np.zeros(2), np.arange(10))
    pose = np.array((0.06, -0.05, 0.04))
    points = find_surface(look_at_legs(pose, LEGS, random), noise).points
    prior = np.diag((1.0 / 0.15**2, 1.0 / 0.15**2, 1.0 / 0.1**2))
    fit = Fit(*fit_scan(local, points, np.zeros(3), prior, 0.012, 24))
    assert fit.share > 0.8
    assert fit.pose == pytest.approx(pose, abs=0.02)


def test_what_is_small_and_free_all_around_in_a_grid_is_a_post() -> None:
    cells = np.zeros((60, 80), dtype=np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    cells[20:22, 30:32] = cells[40, 50] = 100  # a leg of four cells, and one of one
    cells[30:38, 60] = 100  # a short wall
    local = make_grid_map(Grid(cells, 0.05, (-1.0, -2.0)))
    sums = local.sums[: local.used[0]]
    posts = sums[(sums[:, 3] == 0.0) & (sums[:, 4] == 0.0), 1:3]
    assert posts[posts[:, 0].argsort()] == pytest.approx(np.array(((0.55, -0.95), (1.525, 0.025))))
    assert len(sums) > 100


def test_what_is_seen_where_nothing_was_known_speaks_against_no_pose() -> None:
    """Unless all is free there, or a wall is before it."""
    local, places = make_local_map(8.0), Places()
    scan = look(np.zeros(3), np.random.default_rng(0))
    surface = find_surface(scan, NOISE)
    places.add(scan, surface, np.zeros(3))
    places.show(local, np.zeros(2), np.arange(1))
    canvas = Canvas(0.05)
    for _ in range(2):
        canvas.draw(scan, surface, np.zeros(3))
    other = np.array(((0.5, 0.1, -1.0, 0.0, 0.012), (9.0, 9.0, -1.0, 0.0, 0.012)))
    points = np.concatenate((surface.points, other))
    fits, new, _ = count_fitting(local, points, np.zeros(3), 0.012, *canvas.odds)
    assert fits >= 0.97 * len(surface.points)
    assert len(points) - new - fits <= 0.03 * len(surface.points) + 1
    alone = count_fitting(local, other[:1], np.zeros(3), 0.012, *canvas.odds)
    behind = count_fitting(local, other[1:], np.zeros(3), 0.012, *canvas.odds)
    nothing = Canvas(0.05).odds
    beyond = count_fitting(local, other[1:], np.zeros(3), 0.012, *nothing)
    assert (alone, behind, beyond) == ((0, 0, 0), (0, 0, 1), (0, 1, 0))


def test_a_canvas_grows_and_keeps_what_it_has() -> None:
    canvas, scan = Canvas(0.05), look(np.zeros(3), np.random.default_rng(0))
    surface = find_surface(scan, NOISE)
    canvas.draw(scan, surface, np.zeros(3))
    before = canvas.grid()
    canvas.draw(scan, surface, np.array((-30.0, 20.0, 1.0)))
    after = canvas.grid()
    row, column = after.to_cells(before.to_points(np.array(((0, 0),))))[0]
    height, width = before.cells.shape
    assert np.array_equal(after.cells[row : row + height, column : column + width], before.cells)


def test_a_canvas_holds_all_that_is_drawn_where_noise_has_moved_a_surface_out() -> None:
    """A kernel that writes beside its array corrupts what lies there, and nothing says so."""
    canvas, scan = Canvas(0.05), look(np.zeros(3), np.random.default_rng(0))
    surface = find_surface(scan, NOISE)
    canvas.draw(scan, surface._replace(ends=1.1 * surface.ends), np.zeros(3))
    grid = canvas.grid()
    cells = grid.to_cells(1.1 * surface.ends)
    assert (cells > 0).all()
    assert (cells < np.array(grid.cells.shape) - 1).all()


def draw_once(ends: np.ndarray, hits: np.ndarray) -> Grid:
    """Return the grid of one scan from the origin."""
    canvas, scan = Canvas(0.05), Scan(np.zeros(2), ends, hits)
    canvas.draw(scan, find_surface(scan, NOISE), np.zeros(3))
    return canvas.grid()


def rays(angles: np.ndarray, lengths: np.ndarray | float) -> np.ndarray:
    """Return ends of rays from the origin, shape (n, 2)."""
    return np.stack((np.cos(angles), np.sin(angles)), axis=1) * np.reshape(lengths, (-1, 1))


def test_a_cell_is_free_when_its_middle_is_between_two_rays_that_go_on() -> None:
    angles = np.array((0.30, 0.34))
    grid = draw_once(rays(angles, 3.0), np.zeros(2, dtype=np.bool_))
    assert (grid.cells == 100).sum() == 0
    middles = grid.to_points(np.argwhere(grid.cells > -2))
    bearings = np.arctan2(middles[:, 1], middles[:, 0])
    # The triangle ends at the line from end to end.
    reach = np.hypot(*middles.T) * np.cos(bearings - angles.mean())
    inside = (bearings > 0.30) & (bearings < 0.34) & (reach < 3.0 * np.cos(0.02))
    assert inside.sum() > 60
    assert np.array_equal(grid.cells.ravel() == 0, inside)


def test_what_lies_between_rays_that_are_far_apart_stays_unknown() -> None:
    angles = np.array((-0.4, 0.4))
    grid = draw_once(rays(angles, 3.0), np.zeros(2, dtype=np.bool_))
    free = grid.to_points(np.argwhere(grid.cells == 0))
    assert len(free) > 0
    assert (np.abs(free[:, 1]) < 0.075 + 1e-9).all()


def test_rays_past_a_corner_free_no_cell_whose_middle_is_behind_it() -> None:
    # A wall ahead at x = 1 m that ends at y = 0.52 m; beside it rays go on to 4 m.
    angles = np.arange(0.0, 1.2, 0.004)
    front = 1.0 / np.cos(angles)
    hits = front * np.sin(angles) > 0.52
    ends = rays(angles, np.where(hits, front, 4.0))
    for side in (1.0, -1.0):
        free = draw_once(ends * (1.0, side), hits)
        middles = free.to_points(np.argwhere(free.cells == 0)) * (1.0, side)
        beyond = middles[middles[:, 0] > 1.0]
        assert len(beyond) > 1000
        assert (beyond[:, 1] / beyond[:, 0] < 0.52).all()


def test_the_first_scan_shows_the_room_up_to_its_walls() -> None:
    scan = look(np.zeros(3), np.random.default_rng(0))
    grid = draw_once(scan.ends, scan.hits)
    cells = grid.to_cells(rays(np.linspace(-2.8, 2.8, 200), 1.2))
    lengths = np.hypot(*scan.ends.T)
    is_seen = np.interp(np.linspace(-2.8, 2.8, 200), np.linspace(-3.0, 3.0, len(lengths)), lengths)
    assert (grid.cells[tuple(cells[is_seen > 1.5].T)] == 0).all()
    x, y = scan.ends.T
    area = 0.5 * np.abs(x[:-1] * y[1:] - x[1:] * y[:-1]).sum()
    assert (grid.cells == 0).sum() * 0.05**2 == pytest.approx(area, rel=0.06)


def test_places_that_move_are_drawn_anew() -> None:
    random, places, drawing = np.random.default_rng(0), Places(), Drawing(0.05)
    scans = [look(pose, random) for pose in circle(12)]
    for scan, pose in zip(scans, circle(12), strict=True):
        places.add(scan, find_surface(scan, NOISE), pose)
        drawing.add_last(places, NOISE)
    expected, revision = drawing.grid, drawing.revision
    shift = np.array((0.5, -0.25, 0.0))  # whole cells: the same picture, moved
    places.poses[:] += shift
    drawing.see_moves(places)
    for _ in range(12):
        drawing.work(places, NOISE)
    assert drawing.revision == revision + 1
    assert np.subtract(drawing.grid.origin, expected.origin) == pytest.approx(shift[:2])
    assert (drawing.grid.cells != expected.cells).mean() < 0.01


def test_a_robot_that_sees_nothing_is_where_odometry_says() -> None:
    mapper = Mapper()
    poses = circle(30)
    for index, pose in enumerate(poses):
        mapper.step(NOTHING, pose, index * 1e-5 * np.eye(3))
    assert compose(inverse(poses[-1]), mapper.pose) == pytest.approx(np.zeros(3), abs=1e-9)
    assert mapper.grid.cells.size == 0


def test_good_odometry_is_not_made_worse() -> None:
    mapper, random, poses = Mapper(), np.random.default_rng(2), circle(60)
    for index, pose in enumerate(poses):
        mapper.step(look(pose, random), pose, index * 1e-10 * np.eye(3))
        assert math.dist(mapper.pose[:2], pose[:2]) < 0.005


def test_a_search_finds_the_pose_within_a_cell_and_a_step() -> None:
    mapper, random = Mapper(), np.random.default_rng(1)
    for pose in circle(60):
        mapper.step(look(pose, random), pose, np.zeros((3, 3)))
    pyramid = Pyramid(mapper.grid)
    for true in (np.array((0.7, -0.8, 2.0)), np.array((-1.4, 1.1, -0.5))):
        window = Window(pyramid.low, pyramid.high, -math.pi, 240)
        search = Search(pyramid, look(true, random).points, window)
        portions = 0
        while not search.work():
            portions += 1
        assert search.found is not None and portions > 2
        away = search.found.poses[0] - true
        assert np.hypot(away[0], away[1]) < 0.15
        assert abs(math.remainder(away[2], 2.0 * math.pi)) < math.radians(3.0)
        assert (np.diff(search.found.scores) <= 0.0).all()


def test_a_search_without_points_or_map_finds_nothing() -> None:
    pyramid = Pyramid(Grid(np.zeros((4, 4), dtype=np.int8), 0.05, (0.0, 0.0)))
    for points in (np.zeros((0, 2)), np.ones((5, 2))):
        window = Window(pyramid.low, pyramid.high, 0.0, 4)
        search = Search(pyramid, points, window)
        while not search.work():
            pass
        assert search.found is not None and len(search.found.poses) == 0


@for_all('off', [-0.03, 0.03])
def test_what_noise_hits_before_or_behind_a_wall_is_not_occupied(off: float) -> None:
    # The wall is in the middle of cells from 1.00 to 1.05 m; of 33 rays one ends 30 mm off.
    canvas, angles, random = Canvas(0.05), np.arange(-0.5, 0.5, 0.004), np.random.default_rng(0)
    hits = np.ones(len(angles), dtype=np.bool_)
    for _ in range(40):
        lengths = 1.025 / np.cos(angles) + np.where(random.random(len(angles)) < 0.03, off, 0.0)
        scan = Scan(np.zeros(2), rays(angles, lengths), hits)
        canvas.draw(scan, find_surface(scan, NOISE), np.zeros(3))
    grid = canvas.grid()
    occupied = grid.to_points(np.argwhere(grid.cells == 100))
    assert len(occupied) >= 20
    assert occupied[:, 0] == pytest.approx(np.full(len(occupied), 1.025))


@for_all('share', [0.003, 0.01, 0.03])
def test_the_noise_of_ranges_is_learnt_as_a_share_of_them(share: float) -> None:
    """In a room of 9 m by 8 m, where the mean range is 5 m."""
    angles, random = np.linspace(-math.pi, math.pi, 360), np.random.default_rng(2)
    walls = np.minimum(4.5 / np.abs(np.cos(angles)), 4.0 / np.abs(np.sin(angles)))
    noise = RangeNoise(0.005, math.nan)
    for _ in range(20):
        ranges = walls * (1.0 + share * random.normal(size=len(angles)))
        known = noise.step(Scan(np.zeros(2), rays(angles, ranges), np.ones(360, dtype=np.bool_)))
    # 7200 draws, of which neighbours share two thirds; walls are not quite straight in angles.
    assert known == (0.005, pytest.approx(share, rel=0.1))
    noise.reset()
    assert noise.step(NOTHING) == (0.005, 0.0)
    assert RangeNoise(0.005, 0.02).step(NOTHING) == (0.005, 0.02)


def test_cells_of_a_wall_are_right_however_noisy_far_ranges_are() -> None:
    """A wall 5 m away, seen with 1 % of noise: nothing more than a cell off it is occupied."""
    canvas, angles, random = Canvas(0.05), np.arange(-0.4, 0.4, 0.0175), np.random.default_rng(1)
    hits = np.ones(len(angles), dtype=np.bool_)
    for _ in range(60):
        lengths = 5.025 / np.cos(angles) * (1.0 + 0.01 * random.normal(size=len(angles)))
        scan = Scan(np.zeros(2), rays(angles, lengths), hits)
        canvas.draw(scan, find_surface(scan, Noise(0.012, 0.01)), np.zeros(3))
    grid = canvas.grid()
    occupied = grid.to_points(np.argwhere(grid.cells == 100))
    assert len(occupied) > 30
    assert (np.abs(occupied[:, 0] - 5.025) <= 0.051).mean() > 0.98


def test_what_is_known_twice_of_a_pair_is_one_edge_with_the_mean() -> None:
    places = Places()
    for _ in range(3):
        places.add(NOTHING, find_surface(NOTHING, NOISE), np.zeros(3))
    first, second = np.array((1.0, 0.0, 3.1)), np.array((1.3, 0.0, -3.1))
    places.link((0, 1), first, np.diag((2.0, 1.0, 1.0)), sure=False)
    places.link((0, 1), second, np.diag((1.0, 1.0, 1.0)), sure=False)
    places.link((1, 2), first, np.eye(3), sure=True)
    edges = places.edges()
    assert edges.pairs.tolist() == [[0, 1], [1, 2]]
    np.testing.assert_allclose(edges.informations[0], np.diag((3.0, 2.0, 2.0)))
    assert edges.poses[0, :2] == pytest.approx((1.1, 0.0))
    assert abs(edges.poses[0, 2]) == pytest.approx(math.pi)  # the mean of 3.1 and -3.1


def test_what_is_seen_twice_of_a_place_is_joined_in_its_frame() -> None:
    random, places, scratch = np.random.default_rng(0), Places(), make_local_map(8.0)
    here = np.array((0.2, -0.1, 0.4))
    first, second = (find_surface(look(at, random), NOISE) for at in (np.zeros(3), here))
    places.add(look(np.zeros(3), random), first, np.array((1.0, 2.0, 0.5)))
    places.join(0, second.points, here, scratch)
    points = places.points(0)
    # Known as well as both, in one row a cell, on the walls that both have seen.
    both = np.concatenate((first.points, second.points))
    assert (points[:, 4] ** -2.0).sum() == pytest.approx((both[:, 4] ** -2.0).sum(), rel=1e-4)
    assert len(points) < 0.7 * len(both)
    seen = make_local_map(8.0)
    seen.clear(np.zeros(2))
    begins = np.array((0, len(first.points)))
    add_surfaces(seen, np.zeros((1, 3)), first.points, begins)
    fit = Fit(*fit_scan(seen, points, np.zeros(3), 1e-6 * np.eye(3), 0.012, 12))
    assert fit.share > 0.95
    assert np.abs(fit.pose).max() < 0.01
    assert places.visits == [2]


def _edges_fit(places: Places) -> bool:
    """Whether all edges say what poses do."""
    edges, poses = places.edges(), places.poses[places.held]
    return all(
        np.abs(compose(inverse(compose(poses[first], edge)), poses[second])).max() < 1e-9
        for (first, second), edge in zip(edges.pairs, edges.poses, strict=True)
    )


def test_a_place_that_is_merged_leaves_its_links_and_what_was_seen_to_the_other() -> None:
    random, places = np.random.default_rng(0), Places()
    poses = np.array(((0.5, 0.0, 0.3), (1.0, 0.4, 2.0), (0.6, 0.1, -1.0), (1.5, -0.5, 0.1)))
    for pose in poses:
        scan = look(pose, random)
        places.add(scan, find_surface(scan, NOISE), pose)
    known = np.diag((4e4, 9e4, 1e5)) + 1e3
    for pair in ((0, 1), (1, 2), (2, 3), (0, 2)):
        step = compose(inverse(poses[pair[0]]), poses[pair[1]])
        places.link(pair, step, known, sure=pair[1] == pair[0] + 1)
    last = places.scan(2)
    places.merge(2, 0)
    assert places.held.tolist() == [0, 1, 3]
    assert places.scan(2) is None
    drawn = places.scan(0)
    assert transform(poses[0], drawn.ends) == pytest.approx(
        transform(poses[2], last.ends), abs=1e-5
    )
    # (1, 2) is (1, 0) now, (2, 3) is (0, 3), and (0, 2) has gone.
    edges = places.edges()
    assert sorted(map(tuple, edges.pairs.tolist())) == [(0, 1), (0, 2), (1, 0)]
    assert not edges.robust.any()
    assert _edges_fit(places)
    for information in edges.informations:
        assert is_definite(information)
    # What is known has become a little less, as by some millimetres.
    assert np.trace(edges.informations[edges.pairs[:, 1] == 2][0]) < np.trace(known)


def test_a_merged_place_stays_where_it_was_in_the_other_however_that_moves() -> None:
    random, places = np.random.default_rng(0), Places()
    poses = np.array(((0.5, 0.0, 0.3), (0.6, 0.1, -1.0), (0.7, 0.1, 3.0)))
    for pose in poses:
        scan = look(pose, random)
        places.add(scan, find_surface(scan, NOISE), pose)
    places.merge(2, 1)
    places.merge(1, 0)
    shift = np.array((1.0, -2.0, 1.5))
    places.poses[0] = compose(shift, poses[0])
    places.follow()
    for pose, was in zip(places.poses, poses, strict=True):
        assert np.abs(compose(inverse(pose), compose(shift, was))).max() < 1e-9
