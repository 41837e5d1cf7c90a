# SPDX-License-Identifier: Apache-2.0
"""The height scan that policies are trained with: order, frame, values."""

import math

import numpy as np
import pytest
from quadruped_sim.elevation import Elevation
from quadruped_sim.height_scan import height_scan, scan_places


def test_it_looks_at_187_places_of_a_grid_of_10_cm_with_x_fastest():
    places = scan_places(np.zeros(3), 0.0)
    assert places.shape == (187, 2)
    assert np.allclose(places[0], (-0.8, -0.5))
    assert np.allclose(places[1] - places[0], (0.1, 0.0))
    assert np.allclose(places[17] - places[0], (0.0, 0.1))
    assert np.allclose(places[-1], (0.8, 0.5))


def test_the_grid_turns_and_moves_with_the_base():
    places = scan_places(np.array([3.0, -2.0, 0.3]), 0.5 * math.pi)
    assert np.allclose(places[0], (3.5, -2.8))
    assert np.allclose(places[1] - places[0], (0.0, 0.1))


def test_its_values_are_the_base_s_height_above_the_ground_less_training_s_offset():
    position = np.array([1.0, 2.0, 0.32])
    values = height_scan(lambda x, y: 0.1 * x, position, 0.0)
    assert values.shape == (187,)
    expected = 0.32 - 0.1 * scan_places(position, 0.0)[:, 0] - 0.5
    assert np.allclose(values, expected)


def test_of_a_map_it_says_nothing_where_that_knows_nothing():
    elevation = Elevation()
    elevation.add(np.array([[0.4, 0.2, 0.15]]), 1e-4)
    values = height_scan(elevation.at, np.array([0.0, 0.0, 0.3]), 0.0)
    known = np.flatnonzero(np.isfinite(values))
    assert len(known) == 1
    assert values[known] == pytest.approx(0.3 - 0.15 - 0.5)
    assert np.abs(scan_places(np.zeros(3), 0.0)[known[0]] - (0.4, 0.2)).max() <= 0.04
