# SPDX-License-Identifier: Apache-2.0
"""Goals one after another: by Nav2's action, on a patrol; some are missed, all can be ended."""

import math
import time

from action_msgs.msg import GoalStatus
import nav2_client
from navigation_stand_ins import odometry, scan, StandInLocator, StandInPilot
import numpy as np
import pytest
from wasd_navigation.actions import action_type
from wasd_navigation.navigator import Outcome
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.waypoints import PATROL_REST, Waypoints

FollowWaypoints = action_type('FollowWaypoints')
GOALS = [np.array([x, 0.0, 0.0]) for x in (1.0, 2.0, 3.0)]
ARRIVED, FAILED = Outcome('arrived'), Outcome('failed', 'something is in the way')


def test_goals_come_in_turn_and_one_that_fails_is_skipped():
    waypoints = Waypoints(GOALS)
    goals = [waypoints.begin()[0]]
    assert waypoints.end(ARRIVED) is None
    goals.append(waypoints.begin()[0])
    assert waypoints.end(FAILED) is None
    goals.append(waypoints.begin()[0])
    assert waypoints.end(ARRIVED) == ARRIVED
    assert (goals, waypoints.missed) == ([1.0, 2.0, 3.0], [1])


def test_rounds_begin_at_the_first_goal_again():
    waypoints = Waypoints(GOALS, first=2, rounds=2)
    indices = [waypoints.index]
    while waypoints.end(ARRIVED) is None:
        indices.append(waypoints.index)
    assert indices == [2, 0, 1, 2]


def test_a_patrol_ends_when_it_reached_nothing_in_a_round():
    waypoints = Waypoints(GOALS, rounds=None)
    ends = [waypoints.end(outcome) for outcome in [ARRIVED] * 100 + [FAILED] * 2]
    assert ends == [None] * 102
    assert waypoints.end(FAILED).state == 'failed'
    assert waypoints.missed == []  # which would grow for ever


def test_a_patrol_rests_where_it_reached_no_goal_but_the_one_at_which_it_stands():
    waypoints = Waypoints(GOALS[:2], rounds=None)
    assert waypoints.end(ARRIVED) is None
    assert waypoints.end(FAILED) is None
    assert not waypoints.rest(0.05)
    for _ in range(3):
        assert waypoints.end(ARRIVED) is None
        assert waypoints.rest(PATROL_REST - 0.1)
        assert not waypoints.rest(0.2)
        assert waypoints.end(FAILED) is None
        assert not waypoints.rest(0.05)
    waypoints.end(ARRIVED)
    waypoints.rest(PATROL_REST)
    assert waypoints.end(ARRIVED) is None
    assert waypoints.end(ARRIVED) is None
    assert not waypoints.rest(0.05)


def test_a_navigator_on_a_patrol_stands_during_a_rest(unit):
    unit.follow(Waypoints(GOALS[:1], rounds=None))
    step(unit, round(1.5 * PATROL_REST / 0.05))
    assert len(unit.navigator.pilot.goals) == 3
    assert unit.is_following
    unit.stop('a key takes over')
    assert not unit.is_following


def test_a_goal_that_is_cancelled_ends_all():
    assert Waypoints(GOALS).end(Outcome('cancelled', 'a key')) == Outcome('cancelled', 'a key')


@pytest.fixture
def unit():
    made = RobotNavigator(parts=(StandInLocator(), StandInPilot()))
    made.navigator.move(odometry())
    made.navigator.see(scan(), odometry())
    return made


def follow(unit, count=3):
    """Begin to follow; return where the ends are told."""
    told = []
    unit.follow(Waypoints(GOALS[:count], tell=told.append))
    return told


def step(unit, count=40):
    begin = unit._stepped_at or 0.0
    for tick in range(1, count + 1):
        unit.navigator.move(odometry(x=1e-6 * tick))
        unit.navigator.see(scan(), odometry(x=1e-6 * tick))
        unit.step(begin + 0.05 * tick)


def test_a_navigator_drives_to_each_waypoint(unit):
    told = follow(unit)
    step(unit)
    assert [goal[0] for goal in unit.navigator.pilot.goals] == [1.0, 2.0, 3.0]
    assert told == [ARRIVED]
    assert not unit.is_following


@pytest.mark.parametrize('how', ['stop', 'go', 'explore', 'follow', 'refuse', 'lock', 'fall'])
def test_whatever_ends_a_goal_ends_those_after_it(unit, how):
    unit.navigator.pilot.end = ('driving', '')
    told = follow(unit)
    step(unit, 3)
    unit.navigator.locator.grows = True
    {
        'stop': lambda: unit.stop('a key takes over'),
        'go': lambda: unit.go(np.array([9.0, 0.0, 0.0])),
        'explore': unit.explore,
        'follow': lambda: unit.follow(Waypoints([np.array([9.0, 0.0, math.nan])])),
        'refuse': lambda: unit.refuse('no'),
        'lock': lambda: unit.lock('e_stop', True),
        'fall': lambda: setattr(unit, 'refusal', lambda: 'it has fallen'),
    }[how]()
    if how == 'fall':
        step(unit, 1)
    assert [outcome.state for outcome in told] == ['cancelled']
    if how != 'explore':
        step(unit, 3)
    assert 2.0 not in [goal[0] for goal in unit.navigator.pilot.goals]


def test_a_goal_ends_exploring(unit):
    unit.navigator.locator.grows = True
    unit.explore()
    unit.go(np.array([9.0, 0.0, 0.0]))
    assert not unit.is_exploring
    unit.explore()
    follow(unit)
    assert not unit.is_exploring


def test_a_robot_that_cannot_drive_refuses_waypoints(unit):
    unit.refusal = lambda: 'press 2'
    assert follow(unit) == [Outcome('refused', 'press 2')]
    assert unit.navigator.state == 'refused'


class Client(nav2_client.Client):
    """A client of follow_waypoints."""

    def send(self, *places, frame='map', **fields):
        poses = [self.pose(x, frame) for x in places]
        return super().send(poses=poses, **fields)

    def result(self, handle):
        """Return status and result of a goal, while the navigator steps."""
        future = handle.get_result_async()
        self.wait(future.done, self.navigator.step)
        return future.result().status, future.result().result

    @property
    def told(self):
        """The waypoints that feedback told of, one after another."""
        indices = [sent.feedback.current_waypoint for sent in self.feedback]
        return [index for at, index in enumerate(indices) if index not in indices[:at]]


@pytest.fixture
def client(spawn, spin_until):
    made = Client(spawn, spin_until, FollowWaypoints, 'follow_waypoints')
    made.logic.pilot.end = ('arrived', '')
    yield made
    made.close()


slow = pytest.mark.slow
needs_nav2 = pytest.mark.skipif(FollowWaypoints is None, reason='nav2_msgs is not built')


@slow
@needs_nav2
def test_waypoints_are_driven_to_in_turn_with_feedback(client):
    handle = client.send(1.0, 2.0, 3.0)
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.error_code, result.error_msg, list(result.missed_waypoints)) == (0, '', [])
    assert [goal[0] for goal in client.logic.pilot.goals] == [1.0, 2.0, 3.0]


@slow
@needs_nav2
def test_feedback_names_the_waypoint(client):
    client.logic.pilot.end = ('driving', '')
    client.send(1.0, 2.0, goal_index=1)
    client.wait(lambda: client.feedback, client.navigator.step)
    assert client.told == [1]


@slow
@needs_nav2
def test_a_waypoint_that_cannot_be_reached_is_skipped_and_told(client):
    pilot = client.logic.pilot
    begin = pilot.set_goal

    def set_goal(goal, may_be_unknown=False):
        pilot.end = ('refused', 'is in an obstacle') if goal[0] == 2.0 else ('arrived', '')
        begin(goal, may_be_unknown)

    pilot.set_goal = set_goal
    said = []
    client.navigation.say = said.append
    status, result = client.result(client.send(1.0, 2.0, 3.0))
    assert status == GoalStatus.STATUS_SUCCEEDED
    (missed,) = result.missed_waypoints
    assert (missed.index, missed.error_code, missed.goal.pose.position.x) == (1, 600, 2.0)
    assert 'goal refused: is in an obstacle' in said


@slow
@needs_nav2
def test_loops_are_rounds_after_the_first(client):
    client.result(client.send(1.0, 2.0, number_of_loops=1))
    assert [goal[0] for goal in client.logic.pilot.goals] == [1.0, 2.0, 1.0, 2.0]


@slow
@needs_nav2
def test_cancelling_stands_at_once(client):
    client.logic.pilot.end = ('driving', '')
    handle = client.send(1.0, 2.0)
    client.navigator.step()
    client.wait(handle.cancel_goal_async().done)
    assert client.sent[-1] == [0.0, 0.0, 0.0]
    status, result = client.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, 0)
    assert client.logic.goal is None


@slow
@needs_nav2
@pytest.mark.parametrize('by', ['other waypoints', 'a pose'])
def test_another_goal_takes_the_place_of_the_waypoints(client, by):
    client.logic.pilot.end = ('driving', '')
    first = client.send(1.0, 2.0)
    client.navigator.step()
    if by == 'a pose':
        client.navigator._on_goal(client.pose(5.0), {'source_timestamp': time.time_ns()})
    else:
        client.send(5.0)
    status, result = client.result(first)
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, 600)
    assert result.error_msg == 'cancelled: another goal replaced it'
    assert client.logic.goal == pytest.approx([5.0, 0.0, 0.0])


@slow
@needs_nav2
def test_between_two_waypoints_other_ones_take_their_place_and_each_has_its_own_end(client):
    first = client.send(1.0, 2.0)
    client.wait(
        lambda: client.logic.goal is None and client.navigation.is_following, client.navigator.step
    )
    second = client.send(5.0, 6.0)
    assert client.result(first)[0] == GoalStatus.STATUS_ABORTED
    client.logic.pilot.end = ('driving', '')
    client.wait(lambda: client.logic.goal is not None, client.navigator.step)
    client.wait(second.cancel_goal_async().done)
    assert client.result(second)[0] == GoalStatus.STATUS_CANCELED
    assert client.logic.goal is None
    assert not client.navigation.is_following


@slow
@needs_nav2
@pytest.mark.parametrize(
    ('places', 'frame', 'refusal', 'words'),
    [
        ((), 'map', '', 'wanted waypoints from number 0 on, got 0'),
        ((1.0,), 'moon', '', "wanted a pose in 'map' or 'odom', got 'moon'"),
        ((1.0,), 'map', 'press 2, then 5', 'press 2, then 5'),
    ],
)
def test_what_cannot_be_followed_is_aborted_with_the_reason(client, places, frame, refusal, words):
    client.navigation.refusal = lambda: refusal
    status, result = client.result(client.send(*places, frame=frame))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, 600)
    assert result.error_msg == f'refused: {words}'
    assert client.logic.goal is None
