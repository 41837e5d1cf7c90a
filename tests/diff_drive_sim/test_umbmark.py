# SPDX-License-Identifier: Apache-2.0
"""Squares of robots made of arithmetic, whose wheels are not what their odometry believes."""

import math

from cases import for_all
from diff_drive_sim.calibration import least_squares, SquareRun, umbmark, Wheels
from diff_drive_sim.odometry import DiffDriveError
import numpy as np
import pytest

SIDE = 1.0
BELIEVED = Wheels(0.06, 0.06, 0.38)
STEPS = 50


def drive(believed, true, turn, heading=0.0):
    """Return the run of a square by odometry that believes in some wheels, on others."""
    half_turn = 0.25 * math.pi * turn * believed.separation
    legs = [(SIDE, SIDE), (-half_turn, half_turn)] * 4
    paths = np.concatenate([np.tile(np.array(leg) / STEPS, (STEPS, 1)) for leg in legs])
    angles = np.vstack((np.zeros(2), np.cumsum(paths, axis=0))) / believed[:2]
    x, y, yaw = [0.0], [0.0], [heading]
    for left, right in np.diff(angles, axis=0) * true[:2]:
        forward, turned = 0.5 * (left + right), (right - left) / true.separation
        # Exact along an arc: its chord lies along the mean heading.
        chord = forward * np.sinc(0.5 * turned / np.pi)
        x.append(x[-1] + chord * math.cos(yaw[-1] + 0.5 * turned))
        y.append(y[-1] + chord * math.sin(yaw[-1] + 0.5 * turned))
        yaw.append(yaw[-1] + turned)
    wrapped = np.angle(np.exp(1j * np.array(yaw)))
    truth = np.column_stack((x, y, wrapped))
    return SquareRun(turn, angles[:, 0], angles[:, 1], truth, (0.0, 0.0))


def both_ways(true, believed=BELIEVED):
    return [drive(believed, true, turn) for turn in (1, -1)]


def test_a_robot_that_is_what_it_believes_returns_to_its_start():
    result = umbmark(both_ways(BELIEVED), SIDE, BELIEVED.separation)
    assert result.diameter_ratio == pytest.approx(1.0, abs=1e-12)
    assert result.wheelbase_ratio == pytest.approx(1.0, abs=1e-12)
    assert result.largest_error < 1e-12


@for_all('ratio', [0.999, 1.001])
def test_small_errors_are_found_apart_from_each_other(ratio):
    # First order in an error of 0.1 %: what is left is a few times its square.
    wheels = Wheels(0.06, 0.06 * ratio, 0.38)
    result = umbmark(both_ways(wheels), SIDE, BELIEVED.separation)
    assert result.diameter_ratio == pytest.approx(ratio, abs=1e-5)
    # Half the radius error makes the robot turn more, and the wheelbase is blamed for it.
    assert result.wheelbase_ratio == pytest.approx(2.0 / (1.0 + ratio), abs=1e-5)
    wide = Wheels(0.06, 0.06, 0.38 * ratio)
    result = umbmark(both_ways(wide), SIDE, BELIEVED.separation)
    assert result.diameter_ratio == pytest.approx(1.0, abs=1e-5)
    assert result.wheelbase_ratio == pytest.approx(ratio, abs=1e-5)


def test_a_correction_leaves_a_fraction_of_the_error_and_the_mean_radius_as_it_was():
    true = Wheels(0.0603, 0.0597, 0.383)
    first = umbmark(both_ways(true), SIDE, BELIEVED.separation)
    corrected = first.correct(BELIEVED)
    assert 0.5 * (corrected.left_radius + corrected.right_radius) == pytest.approx(0.06)
    second = umbmark(both_ways(true, corrected), SIDE, corrected.separation)
    assert second.largest_error < first.largest_error / 20.0


def test_the_largest_error_is_that_of_the_worse_direction():
    result = umbmark(both_ways(Wheels(0.06, 0.0606, 0.38 * 0.99)), SIDE, BELIEVED.separation)
    errors = [np.linalg.norm(run.return_error) for run in both_ways(Wheels(0.06, 0.0606, 0.3762))]
    assert result.largest_error == pytest.approx(max(errors), rel=1e-6)


@for_all(
    'true',
    [
        Wheels(0.06, 0.06, 0.38),
        Wheels(0.06, 0.0612, 0.38),
        Wheels(0.06, 0.06, 0.38 / 0.26 * 0.38),  # as far off as the course's 0.26 m
        Wheels(0.05, 0.07, 0.25),
    ],
)
@for_all('heading', [0.0, 2.5])
def test_least_squares_finds_the_wheels_however_large_the_error(true, heading):
    runs = [drive(BELIEVED, true, turn, heading) for turn in (1, -1)]
    np.testing.assert_allclose(least_squares(runs), true, rtol=1e-9)


def test_least_squares_averages_noise():
    random = np.random.default_rng(5)
    true = Wheels(0.06, 0.0612, 0.36)
    runs = []
    for turn in (1, -1) * 3:
        run = drive(BELIEVED, true, turn)
        noise = random.normal(size=run.truth.shape) * (0.001, 0.001, 0.001)
        runs.append(SquareRun(turn, run.left, run.right, run.truth + noise, run.odometry))
    np.testing.assert_allclose(least_squares(runs), true, rtol=1e-3)


def test_squares_in_one_direction_only_are_an_error():
    with pytest.raises(DiffDriveError, match='no square to the right'):
        umbmark([drive(BELIEVED, BELIEVED, 1)], SIDE, 0.38)


def test_a_robot_that_has_not_turned_cannot_be_calibrated():
    straight = np.linspace(0.0, 1.0, 10)
    truth = np.column_stack((straight, 0.0 * straight, 0.0 * straight))
    run = SquareRun(1, straight, straight, truth, (0.0, 0.0))
    with pytest.raises(DiffDriveError, match='do not tell turns from straight lines'):
        least_squares([run])
