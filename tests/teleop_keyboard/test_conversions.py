# SPDX-License-Identifier: Apache-2.0
from builtin_interfaces.msg import Time
from teleop_keyboard.conversions import from_twist
from teleop_keyboard.conversions import to_twist
from teleop_keyboard.conversions import to_twist_stamped
from teleop_keyboard.ramp import Twist3

VELOCITY = Twist3(0.1, -0.2, 0.3)


def test_a_velocity_survives_the_way_through_a_message():
    assert from_twist(to_twist(VELOCITY)) == VELOCITY
    stamped = to_twist_stamped(VELOCITY, Time(sec=3), 'base_footprint')
    assert from_twist(stamped) == VELOCITY
    assert (stamped.header.stamp.sec, stamped.header.frame_id) == (3, 'base_footprint')


def test_what_a_plane_lacks_is_zero():
    message = to_twist(VELOCITY)
    assert (message.linear.z, message.angular.x, message.angular.y) == (0.0, 0.0, 0.0)
