# SPDX-License-Identifier: Apache-2.0
"""Mode arbotix with legacy: arbotix_driver behind our controller's interface."""

from dataclasses import replace
import math

from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import DiffDriveParameters
import pytest

DT = 0.002
LEGACY = DiffDriveParameters(
    mode='arbotix', legacy=True, Kp=12.0, Kd=12.0, accel_limit=0.1, cmd_vel_timeout=1.0
)


@pytest.fixture
def unit(mbot):
    return DiffDrive(mbot, LEGACY)


def setpoints(unit, duration):
    """Step and return the set-points after each change of them, with their times [s]."""
    found = []
    for index in range(round(duration / DT)):
        unit.step(0.0, 0.0, DT)
        if not found or found[-1][1] != unit.controller.host.setpoints:
            found.append((round((index + 1) * DT, 3), unit.controller.host.setpoints))
    return found


def test_the_ramp_is_30_times_as_steep_and_comes_every_110_ms(unit):
    unit.controller.command(0.5, 0.0)
    assert setpoints(unit, 0.5) == [(0.002, (0, 0)), (0.11, (41, 41)), (0.22, (68, 68))]


def test_when_commands_cease_it_ramps_down_after_the_time_out(unit):
    unit.controller.command(0.5, 0.0)
    assert setpoints(unit, 1.6)[-2:] == [(1.1, (27, 27)), (1.21, (0, 0))]
    assert unit.controller.state == 'stopped'


def test_time_out_and_ramp_may_change_while_it_drives(unit):
    unit.controller.command(0.5, 0.0)
    unit.parameters = DiffDriveParameters(
        mode='arbotix', legacy=True, accel_limit=1.0, cmd_vel_timeout=0.3
    )
    assert setpoints(unit, 1.0) == [(0.002, (0, 0)), (0.11, (68, 68)), (0.33, (0, 0))]


def test_without_an_accel_limit_it_is_that_of_arbotix(mbot):
    unit = DiffDrive(mbot, DiffDriveParameters(mode='arbotix', legacy=True))
    unit.controller.command(0.5, 0.0)
    assert setpoints(unit, 0.2)[-1] == (0.11, (41, 41))


def test_it_says_what_the_set_points_mean(unit):
    unit.controller.command(0.5, 0.0)
    setpoints(unit, 0.5)
    assert unit.controller.target == (0.5, 0.0)
    assert unit.controller.velocity == pytest.approx((68 * 30.0 / 4100.0, 0.0))
    assert unit.controller.state == 'driving'


def test_a_command_that_is_not_finite_is_refused(unit):
    assert not unit.controller.command(math.nan, 0.0)
    assert unit.controller.refused_commands == 1
    assert setpoints(unit, 0.5) == [(0.002, (0, 0))]


def test_odometry_can_be_set(unit):
    unit.controller.set_odometry(1.0, 2.0, 0.5, unit.controller.covariance)
    state = unit.controller.odometry_state
    assert (state.x, state.y, state.yaw) == (1.0, 2.0, 0.5)


def test_a_time_out_of_zero_never_comes(mbot):
    unit = DiffDrive(mbot, replace(LEGACY, cmd_vel_timeout=0.0))
    unit.controller.command(0.5, 0.0)
    assert setpoints(unit, 3.0)[-1][1][0] > 60
    assert unit.controller.state == 'driving'
