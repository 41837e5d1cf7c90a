# SPDX-License-Identifier: Apache-2.0
"""One goal at a time: it is driven to, ends once, and nothing that is silent or NaN drives."""

import math

from navigation_stand_ins import navigator
from navigation_stand_ins import odometry
from navigation_stand_ins import scan
import numpy as np
import pytest
from wasd_navigation.navigator import SILENCE

DT = 0.05
GOAL = np.array([2.0, 1.0, 0.5])


def test_it_commands_nothing_without_a_goal():
    idle = navigator()
    assert idle.step(DT) is None
    assert idle.state == 'idle'


def test_a_goal_is_driven_to_and_ends_once_with_standstill():
    driven, ended = navigator(), []
    driven.on_end.append(ended.append)
    driven.set_goal(GOAL)
    for _ in range(3):
        assert driven.step(DT) == pytest.approx([0.3, 0.0, 0.1])
    assert driven.step(DT) == pytest.approx(0.0)
    assert [outcome.state for outcome in ended] == ['arrived']
    assert driven.step(DT) is None
    assert driven.state == 'arrived'


def test_poses_are_those_of_the_map():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.move(odometry(0.5, 0.0, 0.2))
    driven.step(DT)
    pose, _, _ = driven.pilot.steps[-1]
    assert pose == pytest.approx([0.5, 1.0, 0.2])
    assert driven.pose == pytest.approx(pose)


def test_a_goal_without_a_yaw_has_that_of_the_line_to_it():
    driven = navigator()
    driven.set_goal(np.array([1.0, 2.0, math.nan]))  # the robot is at (0, 1) in the map
    assert driven.goal[2] == pytest.approx(math.pi / 4.0)


def test_the_pilot_sees_a_scan_once_and_from_where_the_robot_is_now():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.see(scan((2.0, 0.0)), odometry(0.0, 0.0, 0.0))
    driven.move(odometry(0.5, 0.0, math.pi / 2.0))
    driven.step(DT)
    driven.step(DT)
    (_, seen, _), (_, again, _) = driven.pilot.steps
    # Half a metre on and looking left, what was 2 m ahead is 1.5 m to the right.
    assert seen.ends[0] == pytest.approx([0.0, -1.5])
    assert seen.origin == pytest.approx([0.0, 0.5])
    assert again is None


def test_a_goal_waits_standing_for_the_first_scan():
    blind = navigator(placed=False)
    blind.move(odometry())
    blind.set_goal(GOAL)
    assert blind.step(DT) == pytest.approx(0.0)
    assert (blind.state, blind.reason) == ('waiting', 'no scan has come yet')
    blind.see(scan(), odometry())
    assert blind.step(DT)[0] > 0.0


def test_a_robot_that_does_not_know_where_it_is_stands():
    lost = navigator()
    lost.locator.is_found, lost.locator.notice = False, 'looking for where it is'
    lost.set_goal(GOAL)
    assert lost.step(DT) == pytest.approx(0.0)
    assert lost.reason == 'looking for where it is'


def test_it_stands_when_odometry_is_silent_and_goes_on_when_it_speaks():
    driven = navigator()
    driven.set_goal(GOAL)
    for _ in range(round(SILENCE / DT) + 1):
        velocity = driven.step(DT)
        driven.pilot.steps.clear()
    assert velocity == pytest.approx(0.0)
    assert (driven.state, driven.reason) == ('waiting', 'odometry is silent')
    driven.move(odometry())
    assert driven.step(DT)[0] > 0.0


def test_odometry_that_is_not_finite_is_none():
    driven = navigator()
    driven.set_goal(GOAL)
    for _ in range(round(SILENCE / DT) + 1):
        driven.move(odometry(math.nan))
        driven.see(scan(), odometry(math.nan))
        velocity = driven.step(DT)
        driven.pilot.steps.clear()
    assert velocity == pytest.approx(0.0)
    assert len(driven.locator.steps) == 1


def test_a_pilot_that_says_nan_moves_nothing():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.pilot.step = lambda *_: np.array([math.nan, 0.0, 0.0])
    assert driven.step(DT) == pytest.approx(0.0)


def test_cancelling_ends_the_goal_with_a_reason():
    driven, ended = navigator(), []
    driven.on_end.append(ended.append)
    driven.set_goal(GOAL)
    driven.step(DT)
    assert driven.cancel('a key takes over')
    assert not driven.cancel('again')
    assert ended == [('cancelled', 'a key takes over')]
    assert driven.pilot.state == 'idle'
    assert driven.step(DT) is None


def test_another_goal_takes_the_place_of_the_first():
    driven, ended = navigator(), []
    driven.on_end.append(ended.append)
    driven.set_goal(GOAL)
    driven.set_goal(2.0 * GOAL)
    assert ended == [('cancelled', 'another goal has come')]
    assert driven.goal == pytest.approx(2.0 * GOAL)
    assert driven.state == 'driving'


def test_a_refusal_is_an_end_too():
    driven, ended = navigator(), []
    driven.on_end.append(ended.append)
    driven.refuse('press 2, then 5')
    assert ended == [('refused', 'press 2, then 5')]
    assert (driven.state, driven.reason) == ended[0]
    assert driven.step(DT) is None


def test_the_map_to_plan_on_is_looked_at_once_a_second():
    driven = navigator()
    driven.pilot.end = ('driving', '')
    driven.set_goal(GOAL)
    revisions = []
    for _ in range(41):
        driven.move(odometry())
        driven.see(scan(), odometry())
        driven.step(DT)
        revisions.append(driven.pilot.steps[-1][2])
    assert len(set(revisions)) == 3  # at 0, 1 and 2 s


def test_reset_forgets_map_goal_and_pose():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.step(DT)
    driven.reset()
    assert (driven.goal, driven.pose, driven.scans) == (None, None, 0)
    assert not driven.is_placed
    assert driven.locator.steps == []
    assert driven.state == 'idle'
