# SPDX-License-Identifier: Apache-2.0
import math

from builtin_interfaces.msg import Time
from cases import for_all
import pytest
from teleop_keyboard.keys_to_twist import Velocity
from teleop_keyboard.twist_messages import from_twist, is_finite, to_marker
from wasd_core.velocity_messages import stamped, to_twist, to_velocity

VELOCITY = Velocity(0.1, -0.2, 0.4, 0.3)


def test_a_velocity_survives_the_way_through_a_message():
    plain = to_twist(*VELOCITY)
    message = stamped(plain, Time(sec=3), 'base')
    assert (message.header.stamp.sec, message.header.frame_id) == (3, 'base')
    assert from_twist(plain) == from_twist(message) == VELOCITY
    assert to_velocity(plain) == to_velocity(message) == (0.1, -0.2, 0.3)


def test_rolling_and_pitching_are_zero():
    message = to_twist(*VELOCITY)
    assert (message.linear.z, message.angular.x, message.angular.y) == (0.4, 0.0, 0.0)


@for_all('bad', [math.nan, math.inf, -math.inf])
def test_a_velocity_with_one_bad_component_is_not_finite(bad):
    message = to_twist(*VELOCITY)
    assert is_finite(message)
    message.angular.x = bad
    assert not is_finite(message)


def test_the_marker_points_along_the_chord_of_the_arc():
    marker = to_marker(to_twist(0.5, 0.0, 0.3, 1.0), Time(sec=3), 'base')
    start, tip = marker.points
    assert (start.x, start.y) == (0.0, 0.0)
    assert math.hypot(tip.x, tip.y) == pytest.approx(0.5)
    assert math.atan2(tip.y, tip.x) == pytest.approx(0.5)
    assert tip.z - start.z == pytest.approx(0.3)
    assert (marker.header.frame_id, marker.header.stamp.sec) == ('base', 3)
