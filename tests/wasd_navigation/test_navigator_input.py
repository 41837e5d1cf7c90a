# SPDX-License-Identifier: Apache-2.0
"""What the navigator makes of what it hears: jumps in time, frames and scans that are none."""

import array
import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from navigator_rig import goal_at, LEVEL, odometry_at, scan_at
import numpy as np
import pytest
from wasd_core.messages import from_odometry
from wasd_core.rotations import Pose
from wasd_core.topics import tf_message_type
from wasd_navigation.messages import take_fixed_frames
from wasd_navigation.records import Ranges

pytestmark = pytest.mark.slow

FAR = np.array([2.0, 1.0, 0.0])


def test_time_that_jumps_back_begins_anew_and_standing(rig):
    rig.node.step()
    rig.navigation.go(FAR)
    rig.navigation._stepped_at += 1e6
    rig.node.step()
    assert rig.navigator.scans == 0
    assert rig.said[-1] == 'goal cancelled: time has jumped back by 1e+06 s'
    assert rig.sent[-1] == [0.0, 0.0, 0.0]


def test_a_scan_that_waits_keeps_the_frame_that_was_said(make):
    navigation = make().navigation
    navigation.senses.place_frame('tag', 'base', Pose(np.array([0.3, 0.0, 0.2]), np.eye(3)))
    navigation.senses.take_scan(2.0, Ranges([1.0, 2.0, 3.0], -1.0, 1.0, 0.1, 6.0), 'tag')
    odometry = from_odometry(odometry_at(Time(sec=2)))
    navigation.take_odometry(2.0, odometry, ('odom', 'base'))
    scan, _, _ = navigation.navigator.locator.steps[0]
    assert scan.origin == pytest.approx([0.3, 0.0])


def test_a_scan_from_before_all_odometry_is_ignored(rig):
    rig.node._on_scan(scan_at(Time(sec=1)))
    assert rig.navigator.scans == 1
    assert rig.navigation.senses._waiting is None


def test_odometry_that_is_said_again_is_no_sign_of_life(rig):
    moved = []
    rig.navigator.move = moved.append
    stamp = rig.node.get_clock().now().to_msg()
    for _ in range(3):
        rig.node._on_odometry(odometry_at(stamp))
    assert len(moved) == 1


def test_odometry_without_stamps_is_told_of(lone, publish, spawn, spin_until):
    node, said = lone, []
    node._warn = said.append
    publish('odom', odometry_at(Time()))
    spin_until(spawn.pump, lambda: node.navigator.pose is not None)
    assert said == []
    publish('odom', odometry_at(Time(), x=0.1))
    spin_until(spawn.pump, lambda: said)
    assert said == ['odom: the same stamp again: ignored']
    assert node.navigator.pose == pytest.approx([0.0, 1.0, 0.0])


def test_odometry_that_is_set_anew_ends_the_goal(rig):
    rig.navigation.go(FAR)
    for x in (5.0, 5.1):
        rig.navigator.step(0.4)
        rig.look(x)
    assert rig.navigator.goal is not None
    rig.look(0.0)
    assert rig.said[-1] == 'goal cancelled: odometry has leapt'
    assert rig.sent[-1] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize('base', ['', 'map', '/base'])
def test_no_frame_of_the_robot_is_taken_for_the_map(rig, base):
    stamp = rig.node.get_clock().now().to_msg()
    message = odometry_at(stamp, x=0.5)
    message.child_frame_id = base
    rig.node._on_odometry(message)
    for frame in ('', 'map', '/map'):
        assert rig.node.in_map(goal_at(1.0, 2.0, 0.0, frame)) == pytest.approx([1.0, 2.0, 0.0])
    if base != 'map':
        assert rig.node.in_map(goal_at(1.0, 2.0, 0.0, 'base'))[0] == pytest.approx(1.5)


def test_frames_that_go_round_in_a_circle_lead_nowhere(rig):
    for child, parent in (('a', 'b'), ('b', 'a'), ('c', 'c')):
        rig.navigation.senses.place_frame(child, parent, LEVEL)
        assert rig.navigation.senses.mount_of(child) is None


def test_a_frame_that_is_no_number_is_ignored(rig):
    place = TransformStamped(child_frame_id='laser')
    place.header.frame_id = 'base'
    place.transform.translation.x = math.nan
    take_fixed_frames(tf_message_type()(transforms=[place]), rig.navigation.senses)
    assert rig.navigation.senses.mount_of('laser').position == pytest.approx(LEVEL.position)


@pytest.mark.parametrize(
    'broken',
    [
        {'range_max': math.nan},
        {'range_max': math.inf},
        {'range_max': 0.0},
        {'range_min': math.nan},
        {'angle_min': math.inf},
        {'angle_increment': math.nan},
        {'ranges': array.array('f', bytes(4 * 100_001))},
        {'ranges': [math.nan, 0.0, -math.inf]},
    ],
    ids=lambda broken: str(*broken),
)
def test_a_scan_that_is_none_is_ignored(rig, broken):
    rig.look(**broken)
    assert rig.navigator.scans == 1


def test_a_scan_reaches_no_farther_than_a_lidar_can_see(rig):
    rig.look(range_max=1e38, ranges=[1e37, math.inf, 99.0])
    scan, _, _ = rig.navigator.locator.steps[-1]
    assert scan.hits.tolist() == [False, False, True]
    lengths = np.hypot(*(scan.ends - scan.origin).T)
    assert lengths == pytest.approx([30.0, 30.0, 99.0])


def test_what_a_localiser_has_to_say_is_said_once(rig):
    rig.navigator.locator.notice = 'was moved by hand'
    for _ in range(3):
        rig.node.step()
    assert rig.said == ['was moved by hand']
    rig.navigator.locator.notice = None
    rig.node.step()
    assert rig.said == ['was moved by hand']
