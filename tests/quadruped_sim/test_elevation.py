# SPDX-License-Identifier: Apache-2.0
"""The grid of heights around a robot: its filter, its edges, its ring buffer."""

from cases import for_all
import numpy as np
import pytest
from quadruped_sim.elevation import DRIFT, Elevation, MOST_VOTES, RESOLUTION

NOISE = 0.01**2


def middles(elevation):
    """Return x and y of each cell's middle [m], (n, n) each."""
    along = (np.arange(elevation.count) + 0.5) * elevation.resolution
    x, y = elevation.corner[0] + along, elevation.corner[1] + along
    return np.meshgrid(x, y)


def fill(elevation, height, times=1):
    """Add a point a cell, of a height that is a function of x and y."""
    x, y = middles(elevation)
    points = np.stack((x, y, height(x, y)), axis=-1).reshape(-1, 3)
    for _ in range(times):
        elevation.add(points, NOISE)


def test_it_is_a_square_of_four_metres_about_the_robot_and_knows_nothing():
    elevation = Elevation()
    assert elevation.count * elevation.resolution == pytest.approx(4.0)
    assert np.allclose(elevation.corner, -2.0)
    assert np.isnan(elevation.heights()).all()
    assert np.isnan(elevation.at(0.1, 0.1))


@for_all('count', [1, 2, 5, 40])
def test_the_variance_of_n_equal_points_is_the_n_th_part_of_one_s(count):
    elevation = Elevation()
    for _ in range(count):
        elevation.add(np.array([[0.5, -0.3, 0.123]]), NOISE)
    assert elevation.at(0.5, -0.3) == pytest.approx(0.123)
    known = ~np.isnan(elevation.heights())
    assert known.sum() == 1
    assert elevation.variances()[known] == pytest.approx(max(NOISE / count, 1e-6))


def test_the_mean_of_unequal_points_is_weighed_by_their_variances():
    elevation = Elevation()
    elevation.add(np.array([[0.0, 0.0, 0.10], [0.0, 0.0, 0.11]]), np.array([1e-4, 3e-4]))
    assert elevation.at(0.0, 0.0) == pytest.approx((3 * 0.10 + 0.11) / 4)


def test_a_plane_stays_a_plane_and_each_cell_is_where_it_was_seen():
    elevation = Elevation()
    elevation.move_to(np.array([7.31, -3.77]))

    def plane(x, y):
        return 0.2 * x - 0.1 * y + 0.05

    fill(elevation, plane, times=3)
    x, y = middles(elevation)
    assert np.allclose(elevation.heights(), plane(x, y))
    assert np.allclose(elevation.at(x, y), plane(x, y))


def test_rows_are_along_y_and_columns_along_x():
    elevation = Elevation()
    elevation.add(np.array([[1.01, -0.99, 0.3]]), NOISE)
    ((row, column),) = np.argwhere(~np.isnan(elevation.heights()))
    x, y = elevation.corner + (np.array([column, row]) + 0.5) * RESOLUTION
    assert abs(x - 1.01) < RESOLUTION
    assert abs(y + 0.99) < RESOLUTION


def test_cells_that_stay_in_the_square_are_kept_and_others_are_unknown():
    """In steps and in one, along both axes, back and forth."""
    rng = np.random.default_rng(110)
    elevation = Elevation()
    middle = np.zeros(2)
    fill(elevation, lambda x, y: x + 10.0 * y)
    seen = {}
    for _ in range(60):
        x, y = middles(elevation)
        cells = zip(np.round(x, 6).ravel(), np.round(y, 6).ravel(), strict=True)
        was = dict(zip(cells, elevation.heights().ravel(), strict=True))
        middle = middle + rng.normal(0.0, 0.3, 2)
        elevation.move_to(middle)
        assert np.abs(elevation.corner + 2.0 - middle).max() <= 0.5 * RESOLUTION + 1e-9
        x, y = middles(elevation)
        cells = zip(np.round(x, 6).ravel(), np.round(y, 6).ravel(), strict=True)
        expected = [was.get(cell, np.nan) for cell in cells]
        assert np.array_equal(elevation.heights().ravel(), expected, equal_nan=True)
        seen |= was
    elevation.move_to(np.array([500.0, 0.0]))
    assert np.isnan(elevation.heights()).all()


def test_an_outlier_does_not_move_a_cell_that_is_well_known():
    elevation = Elevation()
    for _ in range(20):
        elevation.add(np.array([[0.0, 0.0, 0.0]]), NOISE)
    for height in (0.3, 0.14, -0.2, 0.9, 0.4):
        elevation.add(np.array([[0.0, 0.0, height]]), NOISE)
    assert elevation.at(0.0, 0.0) == 0.0


def test_what_has_changed_for_good_is_believed_after_as_many_points_as_a_cell_has_votes():
    elevation = Elevation()
    for _ in range(1000):
        elevation.add(np.array([[0.0, 0.0, 0.0]]), NOISE)
    for _ in range(int(MOST_VOTES)):
        elevation.add(np.array([[0.0, 0.0, 0.2]]), NOISE)
        assert elevation.at(0.0, 0.0) == 0.0
    elevation.add(np.array([[0.0, 0.0, 0.2]]), NOISE)
    assert elevation.at(0.0, 0.0) == pytest.approx(0.2)


def test_a_step_s_edge_stays_sharp_under_noise_and_outliers():
    rng = np.random.default_rng(111)
    elevation = Elevation()
    for _ in range(30):
        points = np.column_stack((rng.uniform(-1.0, 1.0, (20_000, 2)), np.zeros(20_000)))
        points[:, 2] = np.where(points[:, 0] > 0.4, 0.15, 0.0) + rng.normal(0.0, 0.01, 20_000)
        wild = rng.random(20_000) < 0.1
        points[wild, 2] = rng.uniform(-0.5, 0.5, wild.sum())
        elevation.add(points, NOISE)
    x, y = middles(elevation)
    inside = np.maximum(np.abs(x), np.abs(y)) < 0.95
    off = (elevation.heights() - np.where(x > 0.4, 0.15, 0.0))[inside]
    assert np.abs(off).max() < 0.01


def gap_seen(elevation, width, spill=2):
    """
    See even ground with a gap from x = 0.4 m on, as noise spills it over: points in each cell.

    Return the middles of the cells in the gap; rays come from 0.3 m before and 0.4 m above it.
    """
    x, _ = middles(elevation)
    is_gap = (x > 0.4) & (x < 0.4 + width)
    fill(elevation, lambda x, y: 0.0 * x, times=spill)
    fill(elevation, lambda x, y: np.where(is_gap, np.nan, 0.0), times=8)
    depth = np.arange(0.06, 0.4 * width / 0.3, 0.01)
    walls = [(0.4 + width + 0.01, y, -z) for z in depth for y in np.arange(-0.2, 0.2, 0.02)]
    elevation.clear(np.array(walls), np.array((0.1, 0.0, 0.4)))
    return x[is_gap & (np.abs(x - 0.4 - 0.5 * width) < 0.5 * width - 0.04)]


@for_all('width', [0.12, 0.16, 0.2])
def test_a_gap_that_noise_has_filled_is_one_where_rays_go_below_ground(width):
    elevation = Elevation()
    for x in gap_seen(elevation, width):
        assert elevation.at(x, 0.1) < -0.05
    for x in (0.3, 0.38, 0.4 + width + 0.06):
        assert elevation.at(x, 0.1) == pytest.approx(0.0, abs=1e-3)


def test_rays_to_walls_above_ground_clear_nothing_nor_do_a_few_what_is_well_known():
    elevation = Elevation()
    fill(elevation, lambda x, y: np.where(x > 1.0, 0.16, 0.0), times=10)
    before = elevation.heights()
    for noise in (-0.04, 0.0, 0.02, 0.04):  # of ranges: some points are behind the edge
        risers = [(1.0 + noise, 0.1, z) for z in np.arange(0.01, 0.16, 0.005)]
        elevation.clear(np.array(risers), np.array((0.3, 0.0, 0.4)))
    elevation.clear(np.array([(0.6, 0.1, -0.3)] * 9), np.array((0.3, 0.0, 0.4)))
    np.testing.assert_array_equal(elevation.heights(), before)
    elevation.clear(np.array([(0.6, 0.1, -0.3)] * 20), np.array((0.3, 0.0, 0.4)))
    assert np.nanmin(elevation.heights()) < -0.2


def test_rays_to_points_outside_and_such_as_are_no_numbers_clear_nothing():
    elevation = Elevation()
    fill(elevation, lambda x, y: 0.0 * x)
    before = elevation.heights()
    odd = np.array([(np.nan, 0.0, -1.0), (9.0, 0.0, -1.0), (0.0, 0.0, 0.0)])
    elevation.clear(odd, np.array((0.0, 0.0, 0.4)))
    elevation.clear(np.zeros((0, 3)), np.zeros(3))
    np.testing.assert_array_equal(elevation.heights(), before)


def test_what_is_known_is_trusted_less_as_time_goes_by():
    elevation = Elevation()
    elevation.add(np.array([[0.0, 0.0, 0.1]]), NOISE)
    elevation.age(50.0)
    known = ~np.isnan(elevation.heights())
    assert elevation.variances()[known] == pytest.approx(NOISE + 50.0 * DRIFT)
    assert elevation.at(0.0, 0.0) == pytest.approx(0.1)


def test_points_outside_and_such_as_are_no_numbers_are_left_out():
    elevation = Elevation()
    points = [[2.5, 0.0, 0.1], [0.0, -9.0, 0.1], [np.nan, 0.0, 0.1], [0.0, 0.0, np.inf]]
    elevation.add(np.array(points), NOISE)
    elevation.add(np.array([[0.0, 0.0, 0.1]]), np.nan)
    elevation.add(np.empty((0, 3)), NOISE)
    assert np.isnan(elevation.heights()).all()


def test_a_reset_forgets_everything():
    elevation = Elevation()
    fill(elevation, lambda x, y: 0.0 * x + 0.1)
    elevation.reset()
    assert np.isnan(elevation.heights()).all()
    fill(elevation, lambda x, y: 0.0 * x + 0.3)
    assert np.allclose(elevation.heights(), 0.3)
