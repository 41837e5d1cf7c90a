# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
from mujoco_sim.simulation import MAXIMUM_LAG, MINIMUM_INTERVAL, Pacer
import pytest

START = 100.0  # [s] on the wall clock
STEP = 0.005


def run(pacer, wall_time, cost=0.0):
    """Simulate for a wall time on a host that takes `cost` [s] a step; return simulated time."""
    wall, simulated = START, 0.0
    while wall < START + wall_time:
        if pacer.allowed(wall, simulated) >= simulated + STEP:
            simulated += STEP
            wall += cost
        wall += max(pacer.wait_for(simulated + STEP, wall), 1e-6)
    return simulated


@for_all('speed', [0.5, 1.0, 3.0])
def test_simulated_time_goes_as_fast_as_asked_for(speed):
    assert run(Pacer(speed), 2.0, cost=0.001) == pytest.approx(2.0 * speed, abs=2 * STEP)


def test_speed_zero_never_waits():
    pacer = Pacer(0.0)
    assert pacer.allowed(START, 5.0) == math.inf
    assert pacer.wait_for(1e9, START) == 0.0


def test_time_stands_still_at_the_start():
    pacer = Pacer(1.0)
    assert pacer.allowed(START, 7.0) == 7.0
    assert pacer.wait_for(7.25, START) == pytest.approx(0.25)


def test_a_slow_host_slows_the_robot_down():
    # Each step of 5 ms takes 10 ms: half speed, however long it goes on.
    assert run(Pacer(1.0), 2.0, cost=0.010) == pytest.approx(1.0, abs=2 * STEP)


@for_all('speed', [0.5, 1.0, 2.0])
def test_after_a_standstill_of_the_host_little_is_made_up_for(speed):
    pacer = Pacer(speed)
    pacer.allowed(START, 0.0)
    allowed = pacer.allowed(START + 30.0, 0.0)
    assert allowed == pytest.approx(MAXIMUM_LAG * speed)
    # And from there on at the speed asked for.
    assert pacer.allowed(START + 30.05, allowed) == pytest.approx(allowed + 0.05 * speed)


def test_after_a_restart_time_begins_where_it_is():
    pacer = Pacer(1.0)
    pacer.allowed(START, 0.0)
    pacer.restart()
    assert pacer.allowed(START + 50.0, 3.0) == 3.0


def test_the_factor_is_simulated_over_wall_time():
    pacer = Pacer(0.0)
    pacer.allowed(START, 0.0)
    assert pacer.measure(START + 2.0, 5.0) == pytest.approx(2.5)
    assert pacer.measure(START + 3.0, 5.5) == pytest.approx(0.5)
    assert pacer.real_time_factor == pytest.approx(0.5)


def test_a_pause_does_not_count_as_slowness():
    pacer = Pacer(1.0)
    pacer.allowed(START, 0.0)
    pacer.measure(START + 1.0, 1.0)
    pacer.restart()
    assert pacer.measure(START + 60.0, 1.0) == pytest.approx(1.0)
    pacer.allowed(START + 60.0, 1.0)
    assert pacer.measure(START + 61.0, 2.0) == pytest.approx(1.0)


def test_too_short_an_interval_is_not_measured():
    pacer = Pacer(1.0)
    pacer.allowed(START, 0.0)
    assert pacer.measure(START + 0.5 * MINIMUM_INTERVAL, 0.0) == 0.0
    assert pacer.measure(START + 1.0, 1.0) == pytest.approx(1.0)


@for_all(
    ('speed', 'reached', 'is_hurried'),
    [(1.0, 1.0, False), (1.0, 0.97, False), (1.0, 0.9, True), (0.0, 3.0, True), (4.0, 3.0, True)],
)
def test_a_host_is_hurried_where_the_pace_is_not_reached_or_has_no_end(speed, reached, is_hurried):
    pacer = Pacer(1.0)
    pacer.allowed(START, 0.0)
    assert not pacer.is_hurried  # nothing is known yet
    pacer.measure(START + 1.0, reached)
    pacer.speed = speed
    assert pacer.is_hurried == is_hurried
