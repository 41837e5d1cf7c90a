# SPDX-License-Identifier: Apache-2.0
"""Walking by sight: what a map whose heights are known says to feet and base."""

import math

from cases import for_all
import numpy as np
import pytest
from quadruped_sim.algebra import flatten
from quadruped_sim.elevation import Elevation, RESOLUTION
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.footwork import blank_feet
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.sight import CELLS, find_seen_footholds, PERIOD, Sight, survey
from quadruped_sim.robot_state import BaseMotion
from wasd_core.rotations import yaw_matrix

RISE, TREAD = 0.15, 0.30
RADIUS = 0.022
# What a landing aims above the ground [m].
ABOVE = 0.02
# So far from an edge the choice is to keep [m]: the cells around its own are of one tread.
MARGIN = RESOLUTION


def flat(x, y):
    return 0.0 * x


def stairs(x, y):
    """Return heights of stairs whose first edge is at x = 0, six steps up."""
    return RISE * np.clip(np.floor(x / TREAD) + 1.0, 0.0, 6.0)


def gap(x, y):
    return np.where((x > 0.1) & (x < 0.3), -0.5, 0.0)


def slope(x, y):
    return 0.4 * x


class Looker:
    """A base over a map, whose feet are where they are put."""

    def __init__(self, height, x=0.0, yaw=0.0, holes=lambda x, y: x > math.inf):
        self.terrain = Elevation()
        along = (np.arange(self.terrain.count) + 0.5) * RESOLUTION
        places = np.meshgrid(*(self.terrain.corner[:, None] + along))
        z = np.where(holes(*places), np.nan, height(*places))
        self.terrain.add(np.stack((*places, z), axis=-1).reshape(-1, 3), 1e-4)
        self.sight, self.ground = Sight(), Ground()
        self.sight.terrain = self.terrain
        under = float(height(np.array(x), np.array(0.0)))
        self.position = np.array((x, 0.0, under + 0.3))
        rpy, still = np.array((0.0, 0.0, yaw)), np.zeros(3)
        base = BaseMotion(self.position, still, yaw_matrix(yaw), rpy, still)
        self.robot = flatten({'base': base})
        self.flat_feet, self.feet = blank_feet()
        feet = np.array([(x + a, b, under) for a in (0.19, -0.19) for b in (0.14, -0.14)])
        self.ground.reset(feet)
        self.feet.points[:], self.feet.is_loaded[:] = feet, False

    def look(self, speed=0.4, times=1):
        for _ in range(times):
            self.sight.look(self.position, PERIOD)
            command = np.array((speed, 0.0, 0.0))
            arrays = self.robot, self.flat_feet, self.ground.flat, self.sight.flat
            survey(*arrays, command)
        return self.sight._state

    def land(self, *places, lift_off=None, height=0.05, phase=0.3):
        """Return where feet land that would at places (x, y), and how high they step."""
        above = self.ground.height + ABOVE
        landing = np.array([(*place, above) for place in places] + [(9.0, 9.0, 0.0)] * 4)[:4]
        self.feet.landing[:] = landing
        starts, rises = landing if lift_off is None else np.array(lift_off), np.full(4, height)
        arrivals = np.ones(4)
        stands = np.arange(4) >= len(places)
        schedule = GaitState(stands, np.full(4, phase), 0.2, 0.2, pace=0.0)
        arrays = self.robot, self.flat_feet, self.ground.flat, self.sight.flat
        find_seen_footholds(*arrays, schedule, (starts.astype(float), rises, arrivals, RADIUS))
        return self.feet.landing[: len(places)].copy(), rises[: len(places)]


@for_all(('height', 'is_broken'), [(flat, False), (slope, False), (gap, False), (stairs, True)])
def test_ground_with_steps_is_broken_and_a_plane_is_not_nor_a_gap_in_it(height, is_broken):
    looker = Looker(height)
    assert not looker.sight.is_broken
    looker.look()
    assert looker.sight.is_broken == is_broken
    looker.sight.terrain = None
    looker.sight.look(looker.position, PERIOD)
    assert not looker.sight.is_broken


def test_ground_that_is_not_seen_any_more_is_not_broken():
    looker = Looker(stairs)
    looker.look()
    looker.sight.terrain = Elevation()
    looker.look()
    assert not looker.sight.is_broken


def test_without_a_map_and_with_an_empty_one_nothing_is_seen():
    looker = Looker(flat)
    for terrain in (None, Elevation()):
        looker.sight.reset()
        looker.sight.terrain = terrain
        state = looker.look()
        assert state.share == state.tread_share == 0.0
        assert looker.sight.most == math.inf
        assert looker.sight.tread is None
        landing, rises = looker.land((0.19, 0.14), (0.2, -0.14))
        np.testing.assert_array_equal(landing, [(0.19, 0.14, ABOVE), (0.2, -0.14, ABOVE)])
        assert rises.tolist() == [0.05, 0.05]


def test_on_even_ground_feet_land_where_they_would_as_blind():
    looker = Looker(flat)
    looker.look()
    landing, _ = looker.land((0.193, 0.141))
    np.testing.assert_allclose(landing, [(0.193, 0.141, ABOVE)], atol=1e-9)


@for_all('yaw', [0.0, 0.5])
def test_on_stairs_no_foot_lands_beside_an_edge(yaw):
    looker = Looker(stairs, x=0.1, yaw=yaw)
    looker.look()
    for x in np.arange(-0.2, 0.5, 0.007):
        looker.sight._state.is_held[:] = 0.0
        landing, _ = looker.land((x, 0.1))
        where = landing[0, 0]
        distance = abs((where + 0.5 * TREAD) % TREAD - 0.5 * TREAD)
        # The floor before the first edge is no tread.
        assert where < -MARGIN or distance >= MARGIN - 1e-9
        assert np.hypot(*(landing[0, :2] - (x, 0.1))) < 0.21
        assert landing[0, 2] == pytest.approx(float(stairs(where, 0.0)) + ABOVE, abs=1e-6)


def test_over_a_gap_feet_land_on_either_side_with_room_to_the_edge():
    looker = Looker(gap)
    looker.look()
    for x in np.arange(0.0, 0.4, 0.02):
        looker.sight._state.is_held[:] = 0.0
        landing, _ = looker.land((x, 0.1))
        assert not 0.1 - 0.02 < landing[0, 0] < 0.3 + 0.02
        assert landing[0, 2] == pytest.approx(ABOVE)


def test_a_gap_that_is_not_seen_into_is_none_to_step_on():
    looker = Looker(flat, holes=lambda x, y: (x > 0.1) & (x < 0.3))
    looker.look()
    for x in (0.14, 0.2, 0.26):
        looker.sight._state.is_held[:] = 0.0
        landing, _ = looker.land((x, 0.1))
        assert not 0.1 < landing[0, 0] < 0.3


def test_a_chosen_foothold_is_kept_while_raibert_s_moves_a_little():
    looker = Looker(stairs, x=0.1)
    looker.look()
    first, _ = looker.land((0.295, 0.1))
    for moved in (0.300, 0.305, 0.31):
        looker.look()
        again, _ = looker.land((moved, 0.1))
        assert np.hypot(*(again - first)[0, :2]) < 0.025


def test_a_foothold_of_before_a_gap_in_the_map_is_forgotten():
    looker = Looker(flat)
    looker.look(times=30)
    looker.sight.terrain = Elevation()
    looker.look(times=3)
    looker.land((0.19, 0.14))
    assert looker.sight._state.is_held[0] == 2.0
    looker.look(times=40)
    looker.land()
    looker.sight.terrain = looker.terrain
    looker.look()
    landing, _ = looker.land((-0.40, 0.14))
    np.testing.assert_allclose(landing, [(-0.40, 0.14, ABOVE)], atol=1e-9)


def test_late_in_the_swing_nothing_is_chosen_anew():
    looker = Looker(stairs, x=0.1)
    looker.look()
    first, _ = looker.land((0.295, 0.1))
    looker.look()
    again, _ = looker.land((0.36, 0.1), phase=0.8)
    np.testing.assert_array_equal(first, again)


def test_the_later_in_a_swing_the_nearer_a_new_foothold_is_to_the_one_held():
    """It is 0.3 m at most of a whole swing: later it would come down on the way, in the gap."""
    for phase in (0.05, 0.4, 0.6, 0.7):
        looker = Looker(lambda x, y: np.where((x > 0.1) & (x < 0.2), -0.5, 0.0))
        looker.look()
        first, _ = looker.land((0.12, 0.1))
        assert first[0, 0] < 0.1
        looker.look()
        again, _ = looker.land((0.24, 0.1), phase=phase)
        moved = np.hypot(*(again - first)[0, :2])
        assert moved <= 0.3 * (1.0 - phase) + 1e-9
        assert not 0.1 < again[0, 0] < 0.2 + 0.5 * RADIUS
        assert (again[0, 0] > 0.2) == (phase < 0.3)


def test_a_foot_passes_over_the_highest_ground_between_its_ends():
    def ridge(x, y):
        return np.where((x > 0.0) & (x < 0.08), 0.1, 0.0)

    looker = Looker(ridge, x=-0.2)
    looker.look()
    start = np.tile((-0.15, 0.1, RADIUS), (4, 1))
    landing, rises = looker.land((0.2, 0.1), lift_off=start)
    top = max(start[0, 2], landing[0, 2]) + rises[0]
    assert top - RADIUS >= 0.1 + 0.04
    _, low = Looker(flat).land((0.2, 0.1), lift_off=start)
    assert low[0] == pytest.approx(0.05)


@for_all('yaw', [0.0, 0.7])
def test_the_base_follows_the_slope_around_it(yaw):
    looker = Looker(slope, yaw=yaw)
    state = looker.look(times=100)
    np.testing.assert_allclose(state.plane.gradient, (0.4, 0.0), atol=1e-3)
    assert state.plane.height == pytest.approx(0.0, abs=0.02)
    assert state.share == pytest.approx(1.0, abs=1e-3)


def test_the_base_rises_before_the_feet_reach_the_stairs():
    looker = Looker(stairs, x=-0.4)
    gradient = looker.look(times=100).plane.gradient[0]
    assert 0.05 < gradient < RISE / TREAD


def test_on_stairs_feet_have_their_friction_on_level_treads():
    looker = Looker(stairs, x=0.15)
    places = np.array([(x, y) for x in (0.45, 0.15) for y in (0.14, -0.14)])
    looker.feet.points[:] = np.column_stack((places, stairs(places[:, 0], 0.0)))
    looker.feet.is_loaded[:] = True
    looker.look(times=100)
    np.testing.assert_allclose(looker.sight.tread.normal, (0.0, 0.0, 1.0), atol=1e-3)


def test_on_a_slope_they_have_it_on_the_slope():
    looker = Looker(slope)
    looker.feet.points[:, 2] = 0.4 * looker.feet.points[:, 0]
    looker.feet.is_loaded[:] = True
    looker.look(times=100)
    tilt = math.acos(looker.sight.tread.normal[2])
    assert tilt == pytest.approx(math.atan(0.4), abs=0.06)


def test_feet_tell_how_far_the_map_is_off():
    looker = Looker(flat)
    looker.feet.points[:, 2] += 0.03
    looker.feet.is_loaded[:] = True
    state = looker.look(times=100)
    assert state.lift == pytest.approx(0.03, abs=1e-3)
    landing, _ = looker.land((0.19, 0.14))
    assert landing[0, 2] == pytest.approx(0.03 + ABOVE, abs=1e-3)


def test_before_what_is_high_it_goes_slowly_and_on_even_ground_as_it_likes():
    assert Looker(flat).look().most == math.inf
    assert Looker(stairs, x=-0.3).look().most == pytest.approx(0.4)
    assert Looker(stairs, x=-0.3).look(speed=-0.4).most == math.inf
    assert Looker(gap).look().most == pytest.approx(0.4)
    assert Looker(slope).look().most == math.inf


def test_a_window_has_the_median_so_that_single_wrong_cells_and_holes_do_not_count(rng):
    places = rng.uniform(-0.7, 0.7, (60, 2))

    def near(x, y):
        return (np.hypot(x[..., None] - places[:, 0], y[..., None] - places[:, 1]) < 0.02).any(-1)

    wrong = Looker(lambda x, y: stairs(x, y) + 0.4 * near(*np.broadcast_arrays(x, y)))
    holes = Looker(stairs, holes=near)
    right = Looker(stairs)
    windows = [looker.look().window for looker in (wrong, holes, right)]
    assert np.isfinite(windows[1]).mean() > 0.99
    for window in windows[:2]:
        assert (np.abs(window - windows[2]) > 0.01).mean() < 0.02


def test_a_window_s_edges_are_where_they_are():
    looker = Looker(stairs)
    state = looker.look()
    x = (state.first[0] + np.arange(CELLS) + 0.5) * RESOLUTION
    # The cell that an edge is in may be of either tread.
    clear = np.abs((x + 0.5 * TREAD) % TREAD - 0.5 * TREAD) > RESOLUTION
    heights = np.tile(stairs(x, 0.0), (CELLS, 1))
    np.testing.assert_allclose(state.window[:, clear], heights[:, clear], atol=1e-9)
