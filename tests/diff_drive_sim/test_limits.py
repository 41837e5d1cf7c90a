# SPDX-License-Identifier: Apache-2.0
import math
import random

from cases import for_all
from diff_drive_sim.limits import AxisLimits, AxisRamp
import pytest

DT = 0.005
FOUR = AxisLimits(speed_up=0.5, slow_down=1.0, speed_up_backward=0.25, slow_down_backward=2.0)


def velocities(ramp, target, duration, dt=DT):
    """Return the velocity after each step towards a target."""
    return [ramp.step(target, dt) for _ in range(round(duration / dt))]


@for_all('dt', [0.001, 0.005, 0.02])
@for_all(
    ('begin', 'target', 'slope'),
    [(0.0, 1.0, 0.5), (1.0, 0.0, -1.0), (0.0, -1.0, -0.25), (-1.0, 0.0, 2.0)],
)
def test_each_of_the_four_accelerations_is_the_slope_at_any_rate(begin, target, slope, dt):
    ramp = AxisRamp(FOUR, begin)
    after = velocities(ramp, target, 0.4, dt)[-1]
    assert (after - begin) / 0.4 == pytest.approx(slope, rel=1e-9)


def test_a_reversal_brakes_to_zero_and_goes_on_from_the_same_instant():
    # 0.3 m/s at 1 m/s^2 takes 0.3 s; what is left of 0.5 s speeds up backward at 0.25 m/s^2.
    ramp = AxisRamp(FOUR, 0.3)
    assert ramp.step(-1.0, 0.5) == pytest.approx(-0.25 * 0.2)


def test_without_limits_the_target_is_reached_at_once():
    ramp = AxisRamp(AxisLimits(), -3.0)
    assert ramp.step(5.0, DT) == 5.0


def test_no_time_changes_nothing():
    ramp = AxisRamp(FOUR, 0.3)
    assert ramp.step(1.0, 0.0) == 0.3


def test_what_is_not_given_mirrors_what_is():
    nan = math.nan
    limits = AxisLimits.from_signed(0.8, nan, 2.0, nan, nan, nan, 5.0, nan)
    assert limits == AxisLimits(0.8, 0.8, 2.0, 2.0, 2.0, 2.0, 5.0, 5.0)
    limits = AxisLimits.from_signed(0.8, -0.2, 2.0, -3.0, -1.0, 0.5, 5.0, -6.0)
    assert limits == AxisLimits(0.8, 0.2, 2.0, 3.0, 1.0, 0.5, 5.0, 6.0)
    assert AxisLimits.from_signed() == AxisLimits()


def test_backward_has_a_limit_of_its_own():
    limits = AxisLimits(forward=0.8, backward=0.2)
    assert limits.share(1.6) == 0.5
    assert limits.share(-0.4) == 0.5
    assert limits.share(-0.1) == limits.share(0.0) == 1.0


def test_a_jerk_limited_ramp_takes_as_long_as_its_trapezoid_says():
    # Up and down the acceleration takes a/j each, so dv is covered in dv/a + a/j.
    acceleration, jerk, change = 1.0, 4.0, 0.8
    ramp = AxisRamp(AxisLimits(speed_up=acceleration, rise=jerk, fall=jerk))
    path = velocities(ramp, change, 2.0, 0.001)
    arrived = next(i for i, v in enumerate(path, start=1) if v == change) * 0.001
    assert arrived == pytest.approx(change / acceleration + acceleration / jerk, abs=0.003)


@for_all('seed', range(40))
def test_jerk_and_acceleration_keep_within_their_limits_and_the_target_is_not_passed(seed):
    choose = random.Random(seed)
    dt = choose.choice([0.005, 0.01, 0.02])
    accelerations = [choose.uniform(0.3, 3.0) for _ in range(4)]
    limits = AxisLimits(
        math.inf, math.inf, *accelerations, choose.uniform(0.5, 20.0), choose.uniform(0.5, 20.0)
    )
    ramp = AxisRamp(limits)
    before = slope = 0.0
    for target in (choose.uniform(0.0, 1.0), choose.uniform(-1.0, 0.0)):
        for velocity in velocities(ramp, target, 10.0, dt):
            change = (velocity - before) / dt
            forward = min(velocity, before) > 0.0
            if forward or max(velocity, before) < 0.0:
                up, down = accelerations[:2] if forward else accelerations[2:]
                gains_speed = abs(velocity) > abs(before)
                assert abs(change) <= (up if gains_speed else down) * (1.0 + 1e-9)
            assert -limits.fall - 1e-6 <= (change - slope) / dt <= limits.rise + 1e-6
            assert velocity <= target + 1e-12 if target >= 0.0 else velocity >= target - 1e-12
            before, slope = velocity, change
        assert before == pytest.approx(target, abs=1e-12)


def test_an_infinite_jerk_one_way_leaves_the_other_limited():
    ramp = AxisRamp(AxisLimits(speed_up=1.0, rise=2.0))
    path = velocities(ramp, 0.5, 1.5)
    # The acceleration grows for 0.5 s, by then there are 0.25 m/s; the rest takes 0.25 s.
    assert path[round(0.5 / DT) - 1] == pytest.approx(0.25, abs=0.005)
    assert path[round(0.76 / DT)] == 0.5
