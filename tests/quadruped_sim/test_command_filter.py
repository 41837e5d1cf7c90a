# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import numpy as np
import pytest
from quadruped_sim.command_filter import CommandFilter
from quadruped_sim.presets import GAITS
from quadruped_sim.tuning import CommandParameters

DT = 0.002


def settle(command_filter, seconds, request=None):
    for _ in range(round(seconds / DT)):
        if request is not None:
            command_filter.request(*request)
        command_filter.step(DT)
    return command_filter.command


def test_before_the_first_request_the_command_is_zero():
    np.testing.assert_array_equal(settle(CommandFilter(CommandParameters()), 1.0), 0.0)


@for_all(('limits', 'wanted'), [('guide', (0.4, 0.3, 0.5)), ('sport', (2.0, 0.8, 2.0))])
def test_requests_are_clamped_to_the_preset(limits, wanted):
    parameters = CommandParameters(limits=limits, curve_acceleration=100.0)
    command_filter = CommandFilter(parameters)
    np.testing.assert_allclose(settle(command_filter, 3.0, (10.0, 10.0, 10.0)), wanted)


@for_all('request_', [(2.0, 0.0, 2.0), (-1.5, 0.8, -2.0), (0.5, 0.0, 2.0)])
def test_a_curve_too_fast_for_the_feet_is_driven_more_slowly_on_the_same_curve(request_):
    command = settle(CommandFilter(CommandParameters(curve_acceleration=2.0)), 3.0, request_)
    np.testing.assert_allclose(np.cross(command, request_), 0.0, atol=1e-9)
    inward = np.hypot(*command[:2]) * abs(command[2])
    assert inward == pytest.approx(min(2.0, np.hypot(*request_[:2]) * abs(request_[2])))


def test_between_two_curves_feet_hold_and_ramps_last():
    parameters = CommandParameters()
    command_filter = CommandFilter(parameters)
    settle(command_filter, 3.0, (2.0, 0.0, 1.15))
    before = command_filter.command
    for _ in range(1000):
        command_filter.request(1.15, 0.0, 2.0)
        command = command_filter.step(DT)
        assert abs(command[0] * command[2]) <= parameters.curve_acceleration + 1e-9
        assert abs(command[0] - before[0]) <= parameters.forward_acceleration * DT + 1e-9
        assert abs(command[2] - before[2]) <= parameters.yaw_acceleration * DT + 1e-9
        before = command
    np.testing.assert_allclose(command, (1.15, 0.0, 2.0), atol=1e-9)


def test_acceleration_is_limited():
    command_filter = CommandFilter(CommandParameters())
    np.testing.assert_allclose(settle(command_filter, 0.2, (2.0, 0.0, 0.0)), (0.4, 0.0, 0.0))


def test_with_half_the_grip_it_speeds_up_half_as_fast():
    command_filter = CommandFilter(CommandParameters())
    command_filter.grip = 0.5
    np.testing.assert_allclose(settle(command_filter, 0.2, (2.0, 0.0, 0.0)), (0.2, 0.0, 0.0))


@for_all(('behind', 'share'), [(0.35, 1.0), (0.525, 0.5), (0.7, 0.0), (2.0, 0.0)])
def test_a_command_waits_for_a_robot_that_is_far_behind(behind, share):
    command_filter = CommandFilter(CommandParameters(leash=0.35))
    settle(command_filter, 0.5, (1.0, 0.0, 0.0))
    command_filter.velocity = lambda: np.array((1.0 - behind, 0.0))
    command_filter.request(2.0, 0.0, 0.0)
    assert command_filter.step(DT)[0] - 1.0 == pytest.approx(share * 2.0 * DT, abs=1e-12)


@for_all('velocity', [(0.0, 0.0), (2.0, 0.0), (1.0, 1.0)])
def test_a_command_to_stop_waits_for_nobody(velocity):
    command_filter = CommandFilter(CommandParameters())
    settle(command_filter, 1.0, (1.0, 0.0, 0.0))
    command_filter.velocity = lambda: np.array(velocity)
    np.testing.assert_allclose(settle(command_filter, 0.5, (0.0, 0.0, 0.0)), 0.0, atol=1e-12)


@for_all('bad', [float('nan'), float('inf')])
def test_nan_is_refused_and_changes_nothing(bad):
    command_filter = CommandFilter(CommandParameters())
    settle(command_filter, 1.0, (0.5, 0.0, 0.0))
    before = command_filter.command.copy()
    assert 'not finite' in command_filter.request(bad, 0.0, 0.0)
    command_filter.step(DT)
    np.testing.assert_allclose(command_filter.command, before)


def test_silence_brings_it_to_rest_half_a_second_later():
    command_filter = CommandFilter(CommandParameters())
    settle(command_filter, 1.0, (0.8, 0.0, 0.0))
    assert settle(command_filter, 0.49)[0] == pytest.approx(0.8)
    assert command_filter.is_silent is False
    settle(command_filter, 0.45)
    assert command_filter.is_silent
    np.testing.assert_array_equal(command_filter.command, 0.0)


def test_who_may_not_go_yet_rests_while_the_request_waits_and_gets_older():
    command_filter = CommandFilter(CommandParameters())
    for _ in range(100):
        command_filter.request(0.5, 0.0, 0.0)
        command_filter.step(DT, may_go=False)
    np.testing.assert_array_equal(command_filter.command, 0.0)
    assert settle(command_filter, 0.2)[0] == pytest.approx(0.4)
    for _ in range(300):
        command_filter.step(DT, may_go=False)
    assert command_filter.is_silent


def test_racing_full_speed_goes_in_one_direction_at_a_time():
    """What is asked for lies inside the ellipsoid of the three limits, on the same course."""
    parameters = CommandParameters(limits='race', curve_acceleration=100.0)
    limits = CommandFilter(parameters).limits
    full = np.array((limits.forward, limits.lateral, limits.yaw))
    for axis in range(3):
        request = full * np.eye(3)[axis]
        np.testing.assert_allclose(settle(CommandFilter(parameters), 3.0, request), request)
    command = settle(CommandFilter(parameters), 3.0, full)
    np.testing.assert_allclose(command, full / np.sqrt(3.0))


def test_a_gait_has_limits_of_its_own():
    walking = CommandFilter(CommandParameters(), gait='walk')
    np.testing.assert_allclose(settle(walking, 3.0, (2.0, 0.0, 0.0)), (1.0, 0.0, 0.0))
    walking.tune(CommandParameters())
    np.testing.assert_allclose(settle(walking, 3.0, (2.0, 0.0, 0.0)), (2.0, 0.0, 0.0))


def test_a_bound_gains_speed_more_slowly_than_a_trot():
    command = settle(CommandFilter(CommandParameters(), gait='bound'), 0.2, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(command, (0.35 * 0.4, 0.0, 0.0))


def test_each_gait_does_at_once_what_its_own_ellipsoid_holds():
    for gait, row in GAITS.items():
        parameters = CommandParameters(limits='race', curve_acceleration=100.0)
        full = np.array((row.limits.forward, row.limits.lateral, row.limits.yaw))
        command = settle(CommandFilter(parameters, gait=gait), 9.0, full)
        share = max(np.linalg.norm(full / row.able), 1.0)
        np.testing.assert_allclose(command, full / share, err_msg=gait)


def test_on_the_way_to_another_gait_it_slows_down_to_a_share_of_what_both_can_do():
    command_filter = CommandFilter(CommandParameters(limits='race'))
    settle(command_filter, 3.0, (2.5, 0.0, 0.0))
    command_filter.tune(CommandParameters(limits='race'), 'walk', 'trot')
    assert not command_filter.is_within
    ramped = settle(command_filter, 0.5, (2.5, 0.0, 0.0))
    np.testing.assert_allclose(ramped, (1.5, 0.0, 0.0))  # at a trot's ramp
    settle(command_filter, 1.0, (2.5, 0.0, 0.0))
    assert command_filter.is_within
    np.testing.assert_allclose(command_filter.command, (0.6 * GAITS['walk'].limits.forward, 0, 0))
    command_filter.tune(CommandParameters(limits='race'), 'walk')
    np.testing.assert_allclose(settle(command_filter, 1.0, (2.5, 0.0, 0.0)), (1.0, 0.0, 0.0))
