# SPDX-License-Identifier: Apache-2.0
"""The loop on a motor worked out exactly, with an encoder of 4100 ticks to the metre."""

import math

from cases import for_all
from diff_drive_sim.wheel_loop import count_ticks, Gains, WheelLoop, WheelMotor
import pytest

RADIUS, SCALE, DT = 0.06, 4100.0 * 0.06, 0.005
MOTOR = WheelMotor(speed=25.0, damping=0.3, lag=0.011)
ARBOTIX, COURSE = Gains(5.0, 1.0, 0.0, 50.0), Gains(12.0, 12.0, 0.0, 50.0)


class Wheel:
    """A motor of first order: (duty speed - w) / lag, less what a load takes [rad/s]."""

    def __init__(self, gains=ARBOTIX, lag=MOTOR.lag, load=0.0):
        self.loop = WheelLoop(gains, MOTOR, SCALE)
        self.load, self.lag = load, lag
        self.speed = self.angle = 0.0

    def run(self, wanted, duration):
        """Return the speed after each step [m/s]."""
        decay = math.exp(-DT / self.lag)
        speeds = []
        for _ in range(round(duration / DT)):
            duty = self.loop.step(wanted / RADIUS, count_ticks(self.angle, SCALE), DT)
            final = duty * MOTOR.speed - self.load
            ahead = self.speed - final
            self.angle += final * DT + ahead * self.lag * (1.0 - decay)
            self.speed = final + ahead * decay
            speeds.append(self.speed * RADIUS)
        return speeds


def mean(values):
    return sum(values) / len(values)


@for_all('gains', [ARBOTIX, COURSE])
@for_all('load', [0.0, 1.5, -1.5])
@for_all('wanted', [0.05, -0.05, 0.1, 0.2, 0.5])
def test_it_settles_at_the_speed_that_is_wanted_with_any_load(wanted, load, gains):
    # arbotix's law is off by 45 % at 0.05 m/s. A load of 1.5 rad/s is that of a slope of 15
    # degrees on mbot, and more than 0.05 m/s.
    wheel = Wheel(gains, load=load)
    wheel.run(wanted, 4.0)
    assert mean(wheel.run(wanted, 4.0)) == pytest.approx(wanted, rel=0.005)


@for_all('gains', [ARBOTIX, COURSE])
@for_all('wanted', [0.05, 0.2, 0.5])
def test_a_step_overshoots_by_less_than_5_percent(wanted, gains):
    speeds = Wheel(gains).run(wanted, 3.0)
    assert max(speeds) <= 1.05 * wanted
    assert speeds[round(0.1 / DT)] >= 0.95 * wanted


@for_all('lag', [0.5 * MOTOR.lag, 2.0 * MOTOR.lag])
def test_nor_does_it_with_a_robot_twice_as_light_or_heavy(lag):
    assert max(Wheel(lag=lag).run(0.5, 3.0)) <= 1.05 * 0.5


def test_it_comes_to_rest_and_stays_there():
    wheel = Wheel()
    wheel.run(0.3, 1.0)
    wheel.run(0.0, 0.5)
    assert max(map(abs, wheel.run(0.0, 1.0))) < 1e-9


def test_it_holds_a_wheel_that_a_load_pulls_at():
    wheel = Wheel(load=-1.5)  # downhill
    wheel.run(0.0, 4.0)
    before = wheel.angle
    wheel.run(0.0, 4.0)
    assert abs(wheel.angle - before) * RADIUS < 1e-3


def test_a_wheel_that_was_blocked_does_not_make_up_for_more_than_full_duty_needs():
    loop = WheelLoop(ARBOTIX, MOTOR, SCALE)
    for _ in range(round(60.0 / DT)):
        loop.step(0.2 / RADIUS, 0, DT)
    assert loop.duty == 1.0
    # What is left at full duty: 255 Ko / Kp ticks; without the limit it would be 49,000.
    assert loop._behind * ARBOTIX.Kp / ARBOTIX.Ko <= 255.0 + 5.0


def test_a_command_on_its_way_is_waited_for():
    now, late = WheelLoop(ARBOTIX, MOTOR, SCALE), WheelLoop(ARBOTIX, MOTOR, SCALE, delay=2)
    for loop, start in ((now, 1), (late, 3)):
        angle = 0.0
        for index in range(100):
            loop.step(3.0, count_ticks(angle, SCALE), DT)
            # A motor without lag but with the delay.
            angle += 3.0 * DT if index >= start - 1 else 0.0
    # Both wait for the lag of 11 ms only: 3 rad/s * 11 ms.
    assert late._behind == pytest.approx(now._behind, abs=1.0)


@for_all(('angle', 'ticks'), [(0.0, 0), (0.49, 0), (0.51, 1), (-0.51, -1)])
def test_an_encoder_counts_in_the_middle_of_a_tick(angle, ticks):
    assert count_ticks(angle / SCALE, SCALE) == ticks
