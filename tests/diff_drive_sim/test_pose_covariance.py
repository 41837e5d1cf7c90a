# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math

from diff_drive_sim.odometry import Growth, PlanarCovariance, WheelOdometry
import numpy as np
import pytest

GROWTH = Growth(distance=2.5e-5, turn=1e-4, drift=1e-5)


def matrix(covariance):
    c = covariance
    return np.array([[c.xx, c.xy, c.x_yaw], [c.xy, c.yy, c.y_yaw], [c.x_yaw, c.y_yaw, c.yaw_yaw]])


def drive(geometry, *legs, growth=GROWTH, rate=200.0):
    """Return odometry after legs of (linear, angular, duration)."""
    odometry = WheelOdometry(geometry)
    odometry.growth = growth
    left = right = 0.0
    odometry.step(left, right, 0.0)
    for linear, angular, duration in legs:
        speeds = geometry.wheel_speeds(linear, angular)
        for _ in range(round(duration * rate)):
            left, right = left + speeds[0] / rate, right + speeds[1] / rate
            odometry.step(left, right, 1.0 / rate)
    return odometry


def test_at_the_start_and_as_long_as_it_stands_it_is_sure(geometry):
    assert drive(geometry, (0.0, 0.0, 5.0)).covariance == PlanarCovariance()


def test_a_straight_way_has_its_closed_form(geometry):
    # s = 2 m: along s d; yaw s g; across it s^3 g / 3, which is the yaw's error on the way.
    covariance = drive(geometry, (0.5, 0.0, 4.0)).covariance
    assert covariance.xx == pytest.approx(2.0 * 2.5e-5)
    assert covariance.yaw_yaw == pytest.approx(2.0 * 1e-5)
    assert covariance.yy == pytest.approx(2.0**3 * 1e-5 / 3.0, rel=0.01)
    assert covariance.y_yaw == pytest.approx(2.0**2 * 1e-5 / 2.0, rel=0.01)
    assert covariance.xy == covariance.x_yaw == 0.0


def test_turns_count_both_ways_and_on_the_spot_move_nothing(geometry):
    covariance = drive(geometry, (0.0, 1.0, 2.0), (0.0, -1.0, 2.0)).covariance
    assert covariance.yaw_yaw == pytest.approx(4.0 * 1e-4)
    assert covariance.xx == covariance.yy == pytest.approx(0.0, abs=1e-20)


def test_it_only_grows_and_does_not_depend_on_the_rate(geometry):
    legs = [(0.4, 0.8, 2.0), (-0.4, 0.3, 1.0), (0.0, -1.0, 1.0)]
    whole = matrix(drive(geometry, *legs).covariance)
    part = matrix(drive(geometry, *legs[:2]).covariance)
    assert np.linalg.eigvalsh(whole)[0] >= -1e-15
    assert whole[2, 2] > part[2, 2]
    coarse = matrix(drive(geometry, *legs, rate=50.0).covariance)
    np.testing.assert_allclose(coarse, whole, atol=0.02 * np.abs(whole).max())


@pytest.mark.slow
def test_it_is_what_many_disturbed_drives_scatter_by(geometry):
    """Draw the errors that the model speaks of, drive by them, and compare."""
    random = np.random.default_rng(1)
    growth = Growth(distance=1e-3, turn=1e-3, drift=1e-3)
    steps, forward, turn = 40, 0.03, 0.05
    poses = []
    for _ in range(2000):
        x = y = yaw = 0.0
        for _ in range(steps):
            path = forward + math.sqrt(growth.distance * forward) * random.normal()
            around = growth.turn * turn + growth.drift * forward
            heading = yaw + 0.5 * turn
            x, y = x + path * math.cos(heading), y + path * math.sin(heading)
            yaw += turn + math.sqrt(around) * random.normal()
        poses.append((x, y, yaw))
    scatter = np.cov(np.array(poses).T)
    rate = 1.0
    predicted = drive(geometry, (forward, turn, steps / rate), growth=growth, rate=rate)
    # 2000 drives know a variance to 1 / sqrt(1000).
    np.testing.assert_allclose(
        matrix(predicted.covariance), scatter, atol=0.1 * np.abs(scatter).max()
    )


def test_a_base_beside_the_axle_swings_with_the_heading(geometry):
    beside = replace(geometry, axle_x=0.2)
    covariance = drive(beside, (0.0, 1.0, math.pi)).covariance
    assert covariance.xx + covariance.yy > 1e-6
