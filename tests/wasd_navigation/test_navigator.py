# SPDX-License-Identifier: Apache-2.0
"""One goal at a time: it is driven to, ends once, and nothing that is silent or NaN drives."""

import math

from cases import for_all
from navigation_stand_ins import navigator, odometry, scan
import numpy as np
import pytest
from wasd_navigation.navigator import PATIENCE, SILENCE

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


def test_such_a_yaw_is_that_from_where_the_robot_turns_out_to_be():
    lost = navigator()
    lost.locator.is_found, lost.locator.correction = False, np.array([5.0, 5.0, 0.0])
    lost.set_goal(np.array([1.0, 2.0, math.nan]))
    lost.step(DT)
    lost.locator.is_found, lost.locator.correction = True, np.array([0.0, 1.0, 0.0])
    lost.step(DT)
    assert lost.goal[2] == lost.last_goal[2] == pytest.approx(math.pi / 4.0)
    assert lost.pilot.goals[-1] is lost.goal


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


def driven_without(sense):
    """Return a navigator on its way that has just not heard `sense` for too long."""
    driven = navigator()
    driven.pilot.end = ('driving', '')
    driven.set_goal(GOAL)
    assert driven.step(DT)[0] > 0.0
    for _ in range(round(SILENCE / DT) + 1):
        hear(driven, 'odometry' if sense == 'lidar' else 'lidar')
        velocity = driven.step(DT)
    assert velocity == pytest.approx(0.0)
    return driven


def hear(driven, sense):
    if sense == 'odometry':
        driven.move(odometry())
    else:
        driven.see(scan(), odometry())


SENSES = pytest.mark.parametrize(
    ('sense', 'reason'),
    [('odometry', 'odometry is silent'), ('lidar', 'the lidar is silent or blind')],
)


@SENSES
def test_it_stands_when_a_sense_is_silent_and_goes_on_when_it_speaks(sense, reason):
    driven = driven_without(sense)
    assert (driven.state, driven.reason) == ('waiting', reason)
    driven.move(odometry())
    hear(driven, sense)
    assert driven.step(DT)[0] > 0.0


@SENSES
def test_a_goal_whose_sense_stays_silent_fails(sense, reason):
    driven = driven_without(sense)
    for _ in range(round(PATIENCE / DT)):
        hear(driven, 'odometry' if sense == 'lidar' else 'lidar')
        driven.step(DT)
    assert (driven.state, driven.reason) == ('failed', reason)
    driven.move(odometry())
    hear(driven, sense)
    assert driven.step(DT) is None


@for_all('pause', [1, 20])
def test_a_goal_that_comes_while_the_lidar_is_silent_does_not_move_the_robot(pause):
    driven = navigator()
    for _ in range(round(pause * SILENCE / DT) + 1):
        driven.move(odometry())
        assert driven.step(DT) is None
    driven.set_goal(GOAL)
    for _ in range(20):
        driven.move(odometry())
        assert driven.step(DT) == pytest.approx(0.0)
    assert driven.pilot.steps == []
    driven.see(scan(), odometry())
    assert driven.step(DT)[0] > 0.0


def test_a_scan_that_was_long_on_its_way_is_no_sign_of_life():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.see(scan(), odometry(), SILENCE + 0.01)
    assert driven.step(DT) == pytest.approx(0.0)
    assert driven.reason == 'the lidar is silent or blind'


def test_a_robot_that_is_carried_off_on_its_way_does_not_drive_on_from_elsewhere():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.step(DT)
    driven.locator.is_found, driven.locator.notice = False, 'was moved by hand'
    assert driven.step(DT) == pytest.approx(0.0)
    assert (driven.state, driven.reason) == ('failed', 'was moved by hand')
    assert driven.pilot.state == 'idle'


def test_a_goal_does_not_wait_for_ever_for_the_first_scan():
    blind = navigator(placed=False)
    blind.set_goal(GOAL)
    for _ in range(round(PATIENCE / DT) + 2):
        blind.step(DT)
    assert (blind.state, blind.reason) == ('failed', 'no scan has come yet')


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


def test_a_scan_whose_odometry_has_no_covariance_counts_for_nothing():
    blind = navigator(placed=False)
    blind.move(odometry())
    for number in (math.nan, math.inf):
        blind.see(scan(), odometry()._replace(covariance=np.full((3, 3), number)))
    assert blind.scans == 0
    assert not blind.is_placed
    blind.set_goal(GOAL)
    assert blind.step(DT) == pytest.approx(0.0)
    assert blind.reason == 'no scan has come yet'


def test_standstill_is_its_own_each_time():
    blind = navigator(placed=False)
    blind.set_goal(GOAL)
    blind.step(DT)[:] = 9.0
    assert blind.step(DT) == pytest.approx(0.0)


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
    assert ended == [('cancelled', 'another goal replaced it')]
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


def test_a_refusal_is_of_the_goal_that_was_refused():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.step(DT)
    driven.pilot.recoveries = 3
    driven.refuse('press 2, then 5', np.array([1.0, 2.0, math.nan]))
    assert driven.last_goal == pytest.approx([1.0, 2.0, math.pi / 4.0])
    assert (driven.elapsed, driven.pilot.recoveries) == (0.0, 0)


def test_odometry_that_is_set_anew_leaves_the_robot_where_it_is():
    driven = navigator()
    driven.move(odometry(30.0, 4.0))
    driven.move(odometry(30.5, 4.0))
    before = driven.pose
    assert driven.move(odometry(0.0, 0.0))
    assert driven.pose == pytest.approx(before)
    assert not driven.move(odometry(0.5, 0.0))


def test_reset_forgets_map_goal_and_pose():
    driven = navigator()
    driven.set_goal(GOAL)
    driven.step(DT)
    driven.reset()
    assert (driven.goal, driven.pose, driven.scans) == (None, None, 0)
    assert not driven.is_placed
    assert driven.locator.steps == []
    assert driven.state == 'idle'


def test_a_goal_fails_once_the_robot_has_been_stuck_on_the_way_to_it():
    driven, ended = navigator(), []
    driven.pilot.end = ('driving', '')
    driven.on_end.append(ended.append)
    driven.locator.is_stuck, driven.locator.notice = True, 'stuck: the wheels turn'
    driven.set_goal(GOAL)
    time = 0.0
    while not ended:
        driven.see(scan((2.0, 0.0)), odometry(0.0, 0.0, 0.0))
        driven.move(odometry(0.0, 0.0, 0.0))
        driven.step(DT)
        time += DT
        assert time < 3.0
    assert time > 2.0  # what happened before it came is not its fault
    assert ended[0] == ('failed', 'stuck: the wheels turn')
