# SPDX-License-Identifier: Apache-2.0
"""The action of Nav2's clients: feedback, an end of each goal, cancel, preemption."""

from action_msgs.msg import GoalStatus
import nav2_client
import pytest
from wasd_navigation.actions import action_type

NavigateToPose = action_type('NavigateToPose')
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(NavigateToPose is None, reason='nav2_msgs is not built'),
]


class Client(nav2_client.Client):
    """A client of navigate_to_pose."""

    def send(self, x, frame='map'):
        return super().send(pose=self.pose(x, frame))


@pytest.fixture
def client(spawn, spin_until):
    made = Client(spawn, spin_until, NavigateToPose, 'navigate_to_pose')
    yield made
    made.close()


def test_a_goal_is_driven_to_with_feedback_and_succeeds(client):
    handle = client.send(2.0)
    assert client.logic.goal == pytest.approx([2.0, 0.0, 0.0])
    client.wait(lambda: client.feedback, client.navigator.step)
    feedback = client.feedback[0].feedback
    assert feedback.current_pose.header.frame_id == 'map'
    assert feedback.current_pose.pose.position.y == 1.0
    assert feedback.distance_remaining == 1.5
    assert feedback.estimated_time_remaining.sec == 3
    client.logic.pilot.end = ('arrived', '')
    for _ in range(4):
        client.navigator.step()
    status, result = client.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0)


def test_there_is_no_feedback_before_the_way_is_drawn(client):
    client.send(2.0)
    action, pilot = client.navigator._actions[0], client.logic.pilot
    sent, way = [], pilot.path
    action._handle.publish_feedback = sent.append
    pilot.path = way[:0]
    action.step(0.0, 'map')
    assert not sent
    pilot.path = way
    action.step(1.0, 'map')
    assert len(sent) == 1


def test_feedback_comes_ten_times_a_second_of_its_clock(client):
    client.send(2.0)
    action = client.navigator._actions[0]
    sent = []
    action._handle.publish_feedback = sent.append
    for tick in range(40):
        action.step(0.05 * tick, 'map')
    assert len(sent) == 20


def test_cancelling_stands_at_once(client):
    handle = client.send(2.0)
    client.navigator.step()
    future = handle.cancel_goal_async()
    client.wait(future.done)
    assert len(future.result().goals_canceling) == 1
    assert client.sent[-1] == [0.0, 0.0, 0.0]
    assert client.result(handle)[0] == GoalStatus.STATUS_CANCELED
    assert client.logic.goal is None


def test_each_of_many_cancels_at_once_is_answered(client):
    handle = client.send(2.0)
    client.navigator.step()
    futures = [handle.cancel_goal_async() for _ in range(200)]
    client.wait(lambda: all(future.done() for future in futures))
    assert client.result(handle)[0] == GoalStatus.STATUS_CANCELED
    assert sum(len(future.result().goals_canceling) for future in futures) >= 1


def test_the_next_goal_takes_the_place_of_the_first(client):
    first = client.send(2.0)
    second = client.send(3.0)
    status, result = client.result(first)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_msg == 'cancelled: another goal replaced it'
    assert client.logic.goal == pytest.approx([3.0, 0.0, 0.0])
    client.logic.pilot.end = ('arrived', '')
    for _ in range(4):
        client.navigator.step()
    assert client.result(second)[0] == GoalStatus.STATUS_SUCCEEDED


@pytest.mark.parametrize(
    ('frame', 'refusal', 'words'),
    [
        ('map', 'press 2, then 5', 'refused: press 2, then 5'),
        ('moon', '', "refused: wanted a pose in 'map' or 'odom', got 'moon'"),
    ],
)
def test_what_cannot_be_driven_to_is_aborted_with_the_reason(client, frame, refusal, words):
    client.navigation.refusal = lambda: refusal
    status, result = client.result(client.send(2.0, frame))
    assert status == GoalStatus.STATUS_ABORTED
    assert (result.error_msg, result.error_code) == (words, 1)


@pytest.mark.parametrize(('frame', 'refusal'), [('map', 'it has fallen'), ('moon', '')])
def test_a_goal_that_is_none_leaves_the_robot_standing(client, frame, refusal):
    client.send(2.0)
    client.navigator.step()
    assert client.sent[-1] != [0.0, 0.0, 0.0]
    client.navigation.refusal = lambda: refusal
    client.send(2.0, frame)
    assert client.sent[-1] == [0.0, 0.0, 0.0]


def test_the_next_goal_does_not_make_it_stand(client):
    for _ in range(5):
        client.send(2.0)
        client.navigator.step()
    assert [0.0, 0.0, 0.0] not in client.sent


def test_a_driver_who_takes_over_ends_the_goal(client):
    handle = client.send(2.0)
    client.navigation.stop('a key takes over')
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_msg == 'cancelled: a key takes over'
