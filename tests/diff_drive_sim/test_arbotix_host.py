# SPDX-License-Identifier: Apache-2.0
"""arbotix_driver's side, slips included, against what its arithmetic comes to."""

import math

from cases import for_all
from diff_drive_sim.arbotix import ArbotixHost
import pytest

MS = 1_000_000


def run(host, milliseconds, begin=0):
    """Call the host each 10 ms; return when it did something [ms] and its set-points then."""
    found = []
    for now in range(begin + 10, begin + milliseconds + 1, 10):
        if host.update(now * MS, 0, 0):
            found.append((now, host.setpoints))
    return found


def test_the_next_update_is_due_a_period_after_a_late_one():
    # Called each 10 ms, more than 100 ms have passed after 110 only.
    assert [now for now, _ in run(ArbotixHost(4100.0, 0.26), 500)] == [110, 220, 330, 440]


@for_all(('accel_limit', 'ramp'), [(0.1, [41, 68, 68]), (1.0, [68, 68, 68])])
def test_the_ramp_is_30_times_as_steep_as_it_says(accel_limit, ramp):
    host = ArbotixHost(4100.0, 0.26)
    host.configure(1.0, accel_limit)
    host.command(0.5, 0.0, 0)
    found = [left for _, (left, _) in run(host, 330)]
    # 0.1 m/s^2 would be 0.01 m/s in 0.1 s; 41 ticks in 1/30 s are 0.3 m/s.
    assert found == ramp
    assert pytest.approx(30.0 * 0.1 * 0.1) == 41 * 30.0 / 4100.0


def test_each_wheel_ramps_by_itself_so_the_curve_is_not_kept():
    host = ArbotixHost(4100.0, 0.26)
    host.command(0.5, 2.0, 0)  # wheels 0.24 and 0.76 m/s
    assert [each for _, each in run(host, 330)] == [(32, 41), (32, 82), (32, 103)]


def test_it_ramps_down_too_and_the_time_out_is_looked_at_in_updates_only():
    host = ArbotixHost(4100.0, 0.26)
    host.command(0.5, 0.0, 0)
    found = dict(run(host, 1400))
    # Older than 1 s for the first time at 1100 ms.
    assert [found[now][0] for now in (990, 1100, 1210)] == [68, 27, 0]


def arc(host, linear, angular, duration, rate=10.0):
    """Let the host count a constant twist; return where it should be."""
    half = 0.5 * host._base_width * angular
    for index in range(round(duration * rate) + 1):
        t = index / rate
        left, right = (linear - half) * t, (linear + half) * t
        now = round(1e9 * t) + 200 * MS + index  # a little late each time, hence due
        assert host.update(now, round(left * 1e7), round(right * 1e7))
    turn = angular * duration
    return linear / angular * math.sin(turn), linear / angular * (1.0 - math.cos(turn))


def test_half_a_circle_is_152_mm_off():
    host = ArbotixHost(1e7, 0.38)
    end = arc(host, 0.5, 1.0, math.pi - math.pi % 0.1)
    error = math.hypot(host.x - end[0], host.y - end[1])
    # A chord lies along the heading before it minus the turn, not plus half of it: the whole way,
    # 1 m from end to end, is turned by 3/2 of 0.1 rad.
    assert error == pytest.approx(2.0 * math.sin(0.075) * math.hypot(*end), abs=1e-3)
    assert error == pytest.approx(0.152, abs=0.003)
    assert host.yaw == pytest.approx(1.0 * (math.pi - math.pi % 0.1), abs=1e-5)


def test_straight_ahead_it_is_right():
    host = ArbotixHost(1e7, 0.38)
    for index in range(21):
        host.update(round(1e8 * index) + 200 * MS + index, index * 10**6, index * 10**6)
    assert (host.x, host.y, host.yaw) == pytest.approx((2.0, 0.0, 0.0), abs=1e-9)
    assert (host.linear, host.angular) == pytest.approx((1.0, 0.0), abs=1e-6)
