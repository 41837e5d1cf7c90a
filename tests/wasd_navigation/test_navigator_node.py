# SPDX-License-Identifier: Apache-2.0
"""The navigator over topics: what it publishes, what it drives to, to whom it gives way."""

import math
import time

from geometry_msgs.msg import PoseStamped, TransformStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from navigation_stand_ins import StandInLocator
from navigator_rig import goal_at, LEVEL, located, odometry_at, Rig, scan_at
import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from wasd_core.topics import LATCHED, tf_message_type, TF_STATIC
from wasd_navigation.messages import from_pose, to_occupancy, to_path
from wasd_navigation.odometry import to_planar

pytestmark = pytest.mark.slow


def test_alone_it_maps_from_topics_and_drives_by_cmd_vel(lone, publish, peer, spawn, spin_until):
    node = lone
    maps, transforms, twists = [], [], []
    peer.create_subscription(OccupancyGrid, 'map', maps.append, LATCHED)
    peer.create_subscription(tf_message_type(), '/tf', transforms.append, 10)
    peer.create_subscription(Twist, 'cmd_vel', twists.append, 10)
    place = TransformStamped(child_frame_id='laser')
    place.header.frame_id = 'base'
    place.transform.translation.x = 0.1
    static = peer.create_publisher(tf_message_type(), '/tf_static', TF_STATIC)
    static.publish(tf_message_type()(transforms=[place]))
    spin_until(spawn.pump, lambda: node.navigation.senses._fixed)

    def look():
        stamp = peer.get_clock().now().to_msg()
        publish('scan', scan_at(stamp))
        publish('odom', odometry_at(stamp))

    look()
    spin_until(spawn.pump, lambda: maps and transforms, step=look)
    (sent,) = transforms[-1].transforms
    assert (sent.header.frame_id, sent.child_frame_id) == ('map', 'odom')
    assert to_planar(from_pose(sent.transform)) == pytest.approx([0.0, 1.0, 0.0])
    scan, pose, _ = node.navigator.locator.steps[0]
    assert scan.origin == pytest.approx([0.1, 0.0])
    publish('goal_pose', goal_at(2.0, 1.0, 0.0))
    spin_until(spawn.pump, lambda: len(twists) >= 4, step=look)
    assert [twist.linear.x for twist in twists] == pytest.approx([0.3, 0.3, 0.3, 0.0])
    for _ in range(20):
        spawn.pump.handle(0.01)
    assert len(twists) == 4  # who has arrived leaves cmd_vel to others


def test_a_scan_waits_for_its_odometry_and_for_the_place_of_the_lidar(make):
    node = make()
    stamp = node.get_clock().now().to_msg()
    node._on_scan(scan_at(stamp))
    node.navigation.senses.place_frame('laser', 'base', LEVEL)
    assert node.navigator.scans == 0
    node._on_odometry(odometry_at(stamp, x=0.7))
    assert node.navigator.scans == 1
    _, pose, _ = node.navigator.locator.steps[0]
    assert pose == pytest.approx([0.7, 0.0, 0.0])


def send(rig, goal, age=0):
    """Give it a goal_pose that was sent so long ago [s]."""
    rig.node._on_goal(goal, {'source_timestamp': time.time_ns() - age * 10**9})


def test_a_goal_that_waited_while_the_process_was_stopped_is_ignored_and_said(rig):
    rig.node._absence.beat()
    rig.node._absence._absence._lived_at -= 4.0  # as if the process had been stopped
    send(rig, goal_at(1.0, 2.0, 0.0), age=1)
    assert rig.navigator.goal is None
    assert rig.said == ['goal_pose: it waited while this process stood still: ignored']
    send(rig, goal_at(1.0, 2.0, 0.0))
    assert rig.navigator.goal is not None


@pytest.mark.parametrize(
    ('frame', 'expected'),
    [('map', [1.0, 2.0]), ('', [1.0, 2.0]), ('odom', [1.0, 3.0]), ('base', [1.0, 3.0])],
)
def test_a_goal_may_be_given_in_any_frame_that_is_known(rig, frame, expected):
    send(rig, goal_at(1.0, 2.0, 0.0, frame))
    assert rig.navigator.goal[:2] == pytest.approx(expected)


def test_a_goal_in_another_frame_is_ignored_and_said(rig):
    send(rig, goal_at(1.0, 2.0, 0.0, 'moon'))
    assert rig.navigator.goal is None
    (said,) = rig.said
    assert said == "goal_pose: wanted a pose in 'map' or 'base' or 'odom', got 'moon': ignored"


@pytest.mark.parametrize('frame', ['odom', 'base'])
def test_a_goal_in_its_own_frames_is_ignored_while_it_searches_for_its_place(rig, frame):
    rig.navigator.locator.is_found = False
    send(rig, goal_at(1.0, 2.0, 0.0, frame))
    assert rig.navigator.goal is None
    assert rig.said == [f"goal_pose: wanted a pose in 'map', got {frame!r}: ignored"]


def test_a_goal_that_is_no_pose_is_ignored_and_said(rig):
    warned = []
    rig.node._warn = warned.append  # where nobody looks at a terminal or page, the log has it
    for broken in (PoseStamped(), goal_at(math.nan, 0.0, 0.0)):
        broken.pose.orientation.w = 0.0
        send(rig, broken)
    assert rig.navigator.goal is None
    assert len(rig.said) == 2
    assert warned == rig.said


def test_a_navigator_alone_warns_once_of_a_goal_that_is_none(lone):
    warned, informed = [], []
    lone._warn = warned.append
    lone._log = lone.navigation.say = informed.append
    lone._on_goal(goal_at(math.nan, 0.0, 0.0), {'source_timestamp': time.time_ns()})
    assert (len(warned), len(informed)) == (1, 0)


@pytest.mark.parametrize('lock', ['e_stop', 'pause_navigation'])
def test_a_lock_of_the_mux_stops_it_and_refuses_goals_until_it_is_open(
    rig, publish, lock, spawn, spin_until
):
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    publish(lock, Bool(data=True))
    spin_until(spawn.pump, lambda: rig.navigator.goal is None)
    assert rig.sent[-1] == [0.0, 0.0, 0.0]
    assert rig.said[-1] == f'goal cancelled: {lock} is on'
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    assert rig.said[-1] == f'goal refused: {lock} is on'
    publish(lock, Bool(data=False))
    spin_until(spawn.pump, lambda: not rig.navigation.locks)
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    assert rig.navigator.goal is not None


def test_a_simulator_that_is_paused_ends_the_goal_but_none_that_comes_meanwhile(lone):
    rig = Rig(lone)
    sim_time = Parameter('use_sim_time', value=True)
    lone.set_parameters([sim_time])  # and nobody publishes /clock: it stands still
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    lone._look_at_time(10.0)
    lone._look_at_time(10.4)
    assert rig.navigator.goal is not None
    lone._look_at_time(10.6)
    assert rig.said[-1] == 'goal cancelled: time stands still: is the simulator paused?'
    assert rig.sent[-1] == [0.0, 0.0, 0.0]
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    lone._look_at_time(20.0)
    assert rig.navigator.goal is not None


@pytest.fixture
def alone(lone):
    """Return a navigator that is a node of its own, on its way, and the words of a mux."""
    rig = Rig(lone)
    rig.navigator.pilot.end = ('driving', '')

    def drive(*selected, seconds=0.0):
        for name in selected:
            rig.node._on_selected(String(data=name))
        for _ in range(round(seconds / 0.05)):
            rig.look()
            rig.navigation._stepped_at = rig.node.get_clock().now().nanoseconds * 1e-9 - 0.05
            rig.node.step()
        return rig.navigator.state

    rig.drive = drive
    return rig


FAR = np.array([2.0, 1.0, 0.0])


def test_it_gives_way_to_whom_the_mux_lets_drive(alone, publish, spawn, spin_until):
    publish('selected', String(data=''))
    alone.navigation.go(FAR)
    publish('selected', String(data='navigation'))
    spin_until(spawn.pump, lambda: alone.node._selected == 'navigation', step=alone.look)
    assert alone.navigator.goal is not None
    publish('selected', String(data='keyboard'))
    spin_until(spawn.pump, lambda: alone.navigator.goal is None)
    assert alone.said[-1] == 'goal cancelled: keyboard takes over'


def test_a_lock_of_the_mux_that_has_no_topic_here_stops_the_second_goal_too(alone):
    alone.navigation.go(FAR)
    assert alone.drive('', 'navigation', seconds=0.1) == 'driving'
    alone.navigation.go(FAR)  # takes the place of the first, still selected
    alone.drive('')
    assert alone.said[-1] == 'goal cancelled: a lock takes over'
    assert alone.sent[-1] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ('selected', 'words'),
    [('', 'the mux lets nobody drive'), ('keyboard', 'the mux lets keyboard drive')],
)
def test_who_is_not_relayed_stops_and_does_not_drive_off_when_the_lock_opens(
    alone, selected, words
):
    alone.drive(selected)  # closed before the goal came
    alone.navigation.go(FAR)
    assert alone.drive(seconds=0.4) == 'driving'
    assert alone.drive(seconds=0.3) == 'cancelled'
    assert alone.said[-1] == f'goal cancelled: {words}'
    assert alone.drive('navigation', seconds=0.3) == 'cancelled'


def test_a_mux_that_starts_to_relay_it_in_time_lets_it_drive(alone):
    alone.drive('')
    alone.navigation.go(FAR)
    alone.drive(seconds=0.3)
    assert alone.drive('navigation', seconds=2.0) == 'driving'


def test_without_a_mux_it_drives(alone):
    alone.navigation.go(FAR)
    assert alone.drive(seconds=2.0) == 'driving'


def test_the_loss_of_the_mux_ends_the_goal(alone, peer, publish, spawn, spin_until):
    publish('selected', String(data='navigation'))
    spin_until(spawn.pump, lambda: alone.node._selected == 'navigation', step=alone.look)
    spin_until(spawn.pump, lambda: alone.node._mux_watch._had_any, step=alone.look)
    alone.navigation.go(FAR)
    (mux,) = (one for one in peer.publishers if one.topic_name == '/selected')
    peer.destroy_publisher(mux)
    spin_until(spawn.pump, lambda: alone.navigator.goal is None, step=alone.look)
    assert alone.said[-1] == 'goal cancelled: the mux is gone'
    assert alone.node._selected is None


def test_why_nothing_can_be_driven_to_is_asked_before_and_on_the_way(rig):
    rig.navigation.refusal = lambda: 'press 2, then 5'
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    assert rig.said == ['goal refused: press 2, then 5']
    rig.navigation.refusal = lambda: ''
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    rig.navigation.refusal = lambda: 'it has fallen'
    rig.node.step()
    assert rig.said[-1] == 'goal cancelled: it has fallen'
    assert rig.sent[-1] == [0.0, 0.0, 0.0]


def call(node, name):
    """Return the answer of one of its services."""
    (service,) = (one for one in node.services if one.srv_name.endswith(f'/{name}'))
    return service.callback(Trigger.Request(), Trigger.Response())


def test_how_to_drive_can_be_changed_while_it_runs(rig):
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    answer = rig.node.set_parameters([Parameter('limits.forward', value=0.2)])[0]
    assert answer.successful
    assert rig.said == ['goal cancelled: the driving parameters have changed']
    assert rig.navigator.pilot._limits.forward == 0.2
    assert not rig.node.set_parameters([Parameter('limits.forward', value=-0.2)])[0].successful


def test_its_services_cancel_and_begin_anew(rig):
    assert not call(rig.node, 'cancel').success
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    assert call(rig.node, 'cancel').success
    rig.navigation.go(np.array([2.0, 1.0, 0.0]))
    assert call(rig.node, 'reset').success
    assert rig.navigator.goal is None
    assert rig.navigator.scans == 0


def test_a_service_explores_where_a_map_grows(rig):
    answer = call(rig.node, 'explore')
    assert (answer.success, rig.navigation.is_exploring) == (False, False)
    assert 'saved' in answer.message
    rig.navigator.locator.grows = True
    rig.navigation.lock('e_stop', True)
    answer = call(rig.node, 'explore')
    assert (answer.success, rig.navigation.is_exploring) == (False, False)
    assert answer.message == 'cannot explore: e_stop is on'
    rig.navigation.lock('e_stop', False)
    assert call(rig.node, 'explore').success
    assert rig.navigation.is_exploring
    assert call(rig.node, 'cancel').success is False  # no goal yet, but it explores no more
    assert not rig.navigation.is_exploring


def test_initialpose_is_for_who_has_a_map(rig):
    rig.node._on_initial_pose(located(1.0, 0.5))
    assert 'ignored' in rig.said[-1]
    started = []
    rig.navigator.locator.start = lambda *given: started.append(given)
    rig.node._on_initial_pose(located(1.0, 0.5))
    ((pose, covariance),) = started
    assert pose == pytest.approx([1.0, 0.5, 0.0])
    assert covariance[0, 0] == 0.25
    broken = located(1.0, 0.5)
    broken.pose.covariance[7] = math.nan
    rig.node._on_initial_pose(broken)
    assert rig.said[-1] == 'initialpose: wanted a covariance of finite numbers: ignored'
    rig.node._on_initial_pose(located(1e5, 2.0))
    assert rig.said[-1] == 'initialpose: (100000.00, 2.00) is outside the map: ignored'
    assert len(started) == 1


def test_a_grid_is_a_message_row_by_row_from_its_lowest_corner():
    grid = StandInLocator().grid
    grid.cells[0, 1], grid.cells[1, 0] = 100, -1
    message = to_occupancy(grid, Odometry().header.stamp, 'map')
    assert (message.info.height, message.info.width) == (40, 60)
    assert (message.data[1], message.data[60], message.data[2]) == (100, -1, 0)
    assert message.info.origin.position.x == -1.0


def test_each_place_of_a_path_looks_to_the_next():
    places = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    path = to_path(places, Odometry().header.stamp, 'map')
    yaws = [to_planar(from_pose(place.pose))[2] for place in path.poses]
    assert yaws == pytest.approx([math.pi / 2.0, 0.0, 0.0])
