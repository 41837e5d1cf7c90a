# SPDX-License-Identifier: Apache-2.0
"""Where the robot was when a scan was taken: between two messages, the short way round."""

import math

from navigation_stand_ins import odometry
import pytest
from wasd_navigation.odometry import OdometryMemory


@pytest.fixture
def memory() -> OdometryMemory:
    made = OdometryMemory()
    made.add(1.0, odometry(0.0, 0.0, math.pi - 0.1))
    made.add(2.0, odometry(1.0, -2.0, -math.pi + 0.1))
    return made


def test_between_two_messages_the_pose_is_between_theirs(memory):
    assert memory.at(1.25).pose == pytest.approx([0.25, -0.5, math.pi - 0.05])


def test_at_a_stamp_it_is_that_message(memory):
    assert memory.at(1.0).pose == pytest.approx([0.0, 0.0, math.pi - 0.1])
    assert memory.at(2.0).pose == pytest.approx([1.0, -2.0, -math.pi + 0.1])


def test_what_has_not_come_yet_is_none(memory):
    assert memory.at(2.001) is None


def test_before_all_that_is_kept_nothing_is_known(memory):
    assert memory.at(0.999) is None
    assert memory.age(0.5) == 1.5
    assert math.isnan(OdometryMemory().age(0.5))


def test_a_jump_back_in_time_forgets_the_past(memory):
    memory.add(0.1, odometry(5.0))
    assert memory.at(0.2) is None
    assert memory.at(0.1).pose == pytest.approx([5.0, 0.0, 0.0])
