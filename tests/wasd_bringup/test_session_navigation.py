# SPDX-License-Identifier: Apache-2.0
"""`--map` in a run: it drives to goals, and gives way at once to whatever a driver does."""

import argparse
import itertools
import math
import time

from cases import for_all
from descriptions import robot_named
from geometry_msgs.msg import Twist
from navigation_stand_ins import StandInLocator, StandInPilot
import numpy as np
import pytest
from std_msgs.msg import String
from terminals import wait_until
from wasd_bringup.cli.options import add_run_options, options_of, read_options
from wasd_bringup.cli.run_command import _missed_goals
from wasd_bringup.page.bridge import CockpitBridge
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.inputs import SWITCH_KEY
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_cockpit.link import Order, Stick
from wasd_core.errors import UserError
from wasd_navigation.navigator import Navigator
from wasd_navigation.records import OCCUPIED
from wasd_navigation.traversability import Traversability

from wasd_navigation import robot_navigator

# A goal that the stand-in never reaches.
GOAL = (3.0, 0.0, 0.0)


@pytest.fixture
def session_of(monkeypatch):
    """Return a function that makes a run which maps, with a stand-in that goes straight on."""
    sessions = []

    def make(robot='mbot', make_run=Run, **more):
        pilot = StandInPilot()
        pilot.end = ('driving', '')
        monkeypatch.setattr(robot_navigator, 'make_parts', lambda *_: (StandInLocator(), pilot))
        more = {'description': robot, 'preset': 'mbot', 'map': '', **more}
        sessions.append(make_run(RunOptions(robot=robot, speed=0.0, **more)))
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()


def test_a_robot_that_floats_on_a_world_maps_too(session_of, tmp_path):
    text, root = robot_named('mbot').urdf, robot_named('mbot').robot.root
    hung = (
        '<link name="world"/><joint name="free" type="floating"><parent link="world"/>'
        f'<child link="{root}"/></joint></robot>'
    )
    (path := tmp_path / 'floating.urdf').write_text(text[: text.rindex('</robot>')] + hung)
    session = session_of(description=path)
    session.simulation.advance(1000)
    assert navigation(session).report()['scans'] > 0
    assert session.robot.frames == ('odom', root)


def test_a_robot_slower_than_a_navigator_may_be_told_is_driven_by_its_controller(
    session_of, tmp_path
):
    (file := tmp_path / 'slow.yaml').write_text(
        'linear.x.max_velocity: 0.005\nangular.z.max_acceleration: 0.001\n'
    )
    session = session_of(controller=file)
    session.simulation.advance(1000)
    assert navigation(session).report()['scans'] > 0


@pytest.fixture
def driving(session_of):
    """Return a run that is on the way to a goal."""
    return on_the_way(session_of(goals=(GOAL,)))


@pytest.fixture
def heard(ros, session_of):
    """Return one that other processes can talk to."""
    return on_the_way(session_of(make_run=make_ros_run, goals=(GOAL,)))


def on_the_way(session):
    session.simulation.advance(1000)
    assert wanted(session) == pytest.approx(0.3)
    return session


def navigation(session):
    return session.navigations[session.active]


def wanted(session):
    """Return the speed [m/s] that the wheels are asked for."""
    return session.robot.drive_unit.controller.target.linear


def ended(session):
    """Return how the last goal ended, and why."""
    last = navigation(session).report()['goals'][-1]
    return last['state'], last['reason']


@pytest.mark.slow
def test_a_goal_of_the_command_line_is_driven_to(driving):
    assert driving.world.base().position[0] > 0.05
    assert navigation(driving).navigator.scans == 5  # 5.5 revolutions in a second, from time 0 on


@pytest.mark.slow
def test_nobody_has_to_listen_for_a_scan_and_its_pose_is_of_its_instant(heard):
    scan, pose, _ = navigation(heard).navigator.locator.steps[-1]
    assert len(scan.ends) == 360
    assert scan.origin == pytest.approx([0.0, 0.0], abs=1e-12)
    assert 0.0 < pose[0] < heard.world.base().position[0]


@pytest.mark.slow
def test_a_key_takes_over_in_its_instant(driving):
    for key in ('i', 'k', 'z', 'HELD+i'):
        driving.press(key)
        assert navigation(driving).navigator.goal is None
        assert ended(driving) == ('cancelled', 'a key takes over'), key
        driving.simulation.advance(25)
        assert wanted(driving) != pytest.approx(0.3), key
        driving.press('k')
        driving.simulation.advance(1000)
        assert wanted(driving) == 0.0, key
        navigation(driving).go(GOAL)
        driving.simulation.advance(500)
        assert wanted(driving) == pytest.approx(0.3), key


@pytest.mark.slow
def test_a_key_that_is_let_go_takes_nothing_over(driving):
    driving.press('RELEASE+i')
    assert navigation(driving).navigator.goal is not None


@pytest.mark.slow
def test_the_stick_of_the_page_takes_over(driving, monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    bridge = CockpitBridge(driving)
    bridge._link.hold(Stick(forward=-1.0))
    bridge.step(0.0, 0.0)
    driving.simulation.advance(25)
    assert ended(driving) == ('cancelled', 'a velocity takes over')
    assert wanted(driving) < 0.0
    bridge.close()


@pytest.mark.slow
def test_a_velocity_of_another_process_takes_over(heard):
    cmd_vel = heard.face.faces[0].controller.node.cmd_vel
    message = Twist()
    message.linear.x = -0.1

    def has_taken_over():
        # Again: one that was sent before the end of a pause of this process does not count.
        cmd_vel._on_message(message, {'source_timestamp': time.time_ns()})
        return navigation(heard).navigator.goal is None

    wait_until(has_taken_over)
    heard.simulation.advance(25)
    assert ended(heard) == ('cancelled', 'somebody on /cmd_vel takes over')
    assert wanted(heard) == pytest.approx(-0.1)


@pytest.mark.slow
def test_a_key_of_another_process_takes_over(heard):
    keys = heard.face.faces[0].controller.key_inputs[-1]
    keys._on_message(String(data='k'), {'source_timestamp': 0})
    assert ended(heard) == ('cancelled', 'somebody on /keys takes over')


@pytest.mark.slow
def test_pause_reset_and_suspension_end_the_goal(session_of):
    session = session_of(goals=(GOAL, GOAL, GOAL))
    session.simulation.advance(400)
    session.simulation.paused = True
    session._poll(0.0)
    assert ended(session) == ('cancelled', 'paused')
    session.simulation.paused = False
    session.simulation.advance(200)
    assert navigation(session).navigator.goal is None
    navigation(session).go(GOAL)
    session.stop()
    assert ended(session) == ('cancelled', 'stopped by hand')
    assert wanted(session) == 0.0
    navigation(session).go(GOAL)
    session.simulation.reset()
    assert ended(session) == ('cancelled', 'the robot was put back to its start')
    assert navigation(session).navigator.scans == 0
    session.simulation.advance(500)
    assert navigation(session).navigator.scans > 0
    assert navigation(session).navigator.goal is None


@pytest.mark.slow
def test_goals_that_were_to_follow_go_with_the_one_that_is_cancelled(session_of):
    session = session_of()
    navigates = navigation(session)

    def pause():
        session.simulation.paused = True
        session._poll(0.0)
        session.simulation.paused = False

    def fall():
        navigates.unit.refusal = lambda: 'it has fallen'
        session.simulation.advance(100)
        navigates.unit.refusal = lambda: ''

    def lose_page():
        navigates._is_of_page = True
        navigates.lose_page()

    for end in (pause, fall, lose_page, session.simulation.reset):
        navigates._goals = (GOAL, GOAL)
        session.simulation.advance(400)
        assert wanted(session) > 0.0
        end()
        session.simulation.advance(500)
        assert navigates.navigator.goal is None
        assert wanted(session) == 0.0


def act(session, end):
    """Do what cancels a goal."""
    if end == 'key':
        session.press('k')
    elif end == 'velocity':
        session.robot.drive((0.0, 0.0, 0.0), 'page')
    elif end == 'pause':
        session.simulation.paused = True
        session._poll(0.0)
        session.simulation.paused = False
    else:
        session.simulation.reset()


@pytest.mark.slow
def test_between_two_goals_a_driver_takes_over_as_on_the_way_to_one(session_of):
    session = session_of(goals=(GOAL, GOAL))
    navigates = navigation(session)
    navigates.navigator.pilot.end = ('failed', 'stuck')
    for end in ('key', 'velocity', 'pause', 'reset'):
        done = len(navigates.report()['goals'])
        while len(navigates.report()['goals']) == done:
            session.simulation.advance(1)
        assert navigates.navigator.goal is None
        act(session, end)
        session.simulation.advance(500)
        assert len(navigates.report()['goals']) == done + 2, end
        assert wanted(session) == 0.0, end
        navigates._goals = (GOAL, GOAL)


@pytest.mark.slow
def test_goals_that_were_to_follow_are_in_the_report_however_the_first_one_ends(session_of):
    after = [(4.0, 0.0, 0.0), (5.0, 1.0, 0.5)]
    for end, outcome in (
        (lambda run: run.press('k'), ('cancelled', 'a key takes over')),
        (lambda run: run.close(), ('failed', 'it never began: there was no time for it')),
    ):
        session = session_of(goals=(GOAL, *after))
        session.simulation.advance(400)
        end(session)
        goals = navigation(session).report()['goals']
        assert [goal['goal'] for goal in goals] == [list(goal) for goal in (GOAL, *after)]
        assert [(goal['state'], goal['reason']) for goal in goals[1:]] == [outcome] * 2


@pytest.mark.slow
def test_goals_that_were_to_follow_are_driven_to_after_one_that_has_failed(session_of):
    session = session_of(goals=(GOAL, GOAL))
    navigation(session).navigator.pilot.end = ('failed', 'stuck')
    session.simulation.advance(1000)
    assert [goal['state'] for goal in navigation(session).report()['goals']] == ['failed'] * 2


@pytest.mark.slow
def test_a_robot_whose_lidar_falls_silent_stands_also_for_the_next_goal(driving):
    sensors = driving.robot.sensors
    sensors._sensors, sensors._beats = [], []  # none of them measures any more
    driving.simulation.advance(1500)
    assert wanted(driving) == 0.0
    navigation(driving).disarm()
    navigation(driving).go(GOAL)
    driving.simulation.advance(500)
    assert wanted(driving) == 0.0
    assert navigation(driving).view().reason == 'the lidar is silent or blind'


@pytest.mark.slow
def test_keys_that_latch_give_way_to_a_goal(session_of):
    session = session_of(preset='ramps')
    session.simulation.advance(100)
    session.press('w')
    session.simulation.advance(500)
    navigation(session).go(GOAL)
    session.simulation.advance(1000)
    assert wanted(session) == pytest.approx(0.3)


@pytest.mark.slow
def test_the_page_orders_goals_and_shows_the_map(session_of, monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    session = session_of()
    bridge = CockpitBridge(session)
    bridge.step(0.0, 0.0)
    assert bridge._link.snapshot.navigation is None  # no map yet
    session.simulation.advance(200)
    bridge._link.order(Order('goal', f'1.0 2.0 {math.nan}'))
    bridge.step(1.0, 0.0)
    shown = bridge._link.snapshot
    assert shown.navigation.state == 'driving'
    assert shown.navigation.goal == pytest.approx((1.0, 2.0, math.pi / 4.0))
    # The stand-in's map is one metre to the left of the world.
    assert shown.marks.path[1] == pytest.approx([1.0, 1.0], abs=0.01)
    bridge._link.order(Order('cancel goal'))
    bridge.step(2.0, 0.0)
    assert bridge._link.snapshot.navigation.goal is None
    assert ended(session) == ('cancelled', 'stopped by hand')
    bridge.close()


@pytest.mark.slow
def test_a_goal_of_the_page_ends_with_it_and_others_do_not(driving):
    navigation(driving).lose_page()
    driving.simulation.advance(100)
    assert wanted(driving) == pytest.approx(0.3)
    navigation(driving).go(GOAL, from_page=True)
    navigation(driving).lose_page()
    assert ended(driving) == ('cancelled', 'the page is gone')
    driving.simulation.advance(100)
    assert wanted(driving) == 0.0


@pytest.mark.slow
def test_exploring_that_others_ask_for_after_the_pages_does_not_end_with_it(
    session_of, monkeypatch
):
    session = session_of()
    session.simulation.advance(500)
    navigates = navigation(session)
    monkeypatch.setattr(navigates.navigator.locator, 'grows', True, raising=False)
    navigates.unit.lock('e_stop', True)
    assert navigates.no_exploring == 'e_stop is on'
    navigates.unit.lock('e_stop', False)
    navigates.explore(from_page=True)
    session.press('i')
    session.press('k')
    session.simulation.advance(100)
    navigates.unit.explore()  # as the service does
    navigates.lose_page()
    assert navigates.unit.is_exploring
    navigates.explore(from_page=True)
    navigates.unit.explore()  # while it still explores for the page
    navigates.lose_page()
    assert navigates.unit.is_exploring
    navigates.explore(from_page=True)
    session.simulation.advance(100)
    navigates.lose_page()
    assert not navigates.unit.is_exploring


@pytest.mark.slow
def test_the_page_sees_the_ground_as_it_is_seen_though_the_map_stays(session_of):
    session = session_of()
    session.simulation.advance(500)
    navigates = navigation(session)
    navigator = navigates.navigator
    navigator.ground = Traversability(0.17)
    before, revision = navigates.view(), navigator.locator.revision
    wall = np.where(np.arange(40) < 20, 0.0, 1.0) * np.ones((40, 1))
    navigator.ground.take(wall, np.array([-0.5, -0.5]), 0.05, 0.0, np.zeros(3), 0.05)
    session.simulation.advance(1200)
    navigator.locator.revision = revision
    after = navigates.view()
    assert after.number != before.number
    assert (after.cells == OCCUPIED).any()
    assert navigates.view().number == after.number


@pytest.mark.slow
def test_maps_of_two_robots_have_different_numbers(session_of):
    session = session_of('both', preset='unitree')
    numbers = [[], []]
    for _ in range(4):
        session.simulation.advance(1100)
        for each, seen in zip(session.navigations, numbers, strict=True):
            each.navigator.locator.revision = len(seen) + 1
            seen.append(each.view().number)
    assert len({*numbers[0], *numbers[1]}) == 8


@pytest.fixture
def both(session_of):
    """Return a run of two robots, of which the second, mbot, is in turn and drives to a goal."""
    session = session_of('both', preset='unitree')
    session.press(SWITCH_KEY)
    session.simulation.advance(100)
    navigation(session).go(GOAL, from_page=True)
    session.simulation.advance(200)
    assert wanted(session) == pytest.approx(0.3)
    return session


@pytest.mark.slow
def test_tab_ends_the_goal_of_the_robot_that_it_leaves(both):
    mbot, driven = both.robot, navigation(both)
    both.press(SWITCH_KEY)
    assert driven.navigator.goal is None
    (goal,) = driven.report()['goals']
    assert (goal['state'], goal['reason']) == ('cancelled', 'the keys go to another robot')
    both.simulation.advance(100)
    assert mbot.drive_unit.controller.target.linear == 0.0
    assert any('TAB the one it leaves' in line for line in both.first_lines)


@pytest.mark.slow
def test_a_goal_sent_to_the_robot_that_is_not_in_turn_ends_by_tab_and_a_key(both):
    driven = navigation(both)
    both.press(SWITCH_KEY)
    driven.go(GOAL)
    for key in ('2', SWITCH_KEY):
        both.press(key)
        assert driven.navigator.goal is not None
    both.press('k')
    assert driven.navigator.goal is None


@pytest.mark.slow
@pytest.mark.parametrize('end', ['stop', 'pause'])
def test_a_stop_and_a_pause_end_the_goal_of_the_robot_that_is_not_in_turn(
    both, end, monkeypatch, tmp_path
):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    driven = navigation(both)
    both.press(SWITCH_KEY)
    driven.go(GOAL)
    if end == 'stop':
        bridge = CockpitBridge(both)
        bridge._link.order(Order('e-stop'))
        bridge.step(0.0, 0.0)
        bridge.close()
    else:
        both.simulation.paused = True
        both._poll(0.0)
    assert driven.navigator.goal is None


@pytest.mark.slow
def test_each_of_two_robots_has_a_map_of_its_own_name(both):
    names = [each.unit.settings.save_map for each in both.navigations]
    assert names == ['go2_map', 'mbot_map']


@pytest.mark.slow
def test_a_go2_that_does_not_follow_velocities_says_what_to_press(session_of):
    session = session_of('go2', preset='unitree')
    session.simulation.advance(100)
    navigation(session).go(GOAL)
    assert ended(session) == ('refused', 'press 2 to stand, then 5 to move: it is passive')
    assert 'press 2' in session.robot.status().message


@pytest.mark.slow
def test_a_cure_is_shown_until_it_is_applied(session_of):
    session = session_of(latched=True)
    session.simulation.advance(500)
    navigates = navigation(session)

    def shown():
        view = navigates.view()
        return view.state, view.reason

    session.e_stop('page')
    navigates.go(GOAL)
    assert shown() == ended(session) == ('refused', 'ENTER releases E-STOP (by the page)')
    session.end_e_stop()
    assert shown() == ('idle', '')
    session.e_stop('page')  # a later stop is not about that goal
    assert shown() == ('idle', '')
    session.end_e_stop()
    navigates.go(GOAL)
    navigates.disarm()
    assert shown() == ended(session) == ('cancelled', 'stopped by hand')


@pytest.mark.slow
def test_a_goal_of_the_command_line_says_what_it_waits_for(session_of):
    dog = session_of('go2', preset='unitree', goals=(GOAL,))
    line = 'maps: the goal waits: press 2 to stand, then 5 to move; any key takes over'
    assert navigation(dog).first_line == line
    dog.press('2')
    dog.simulation.advance(3000)
    assert dog.robot.refusal == 'press 5 to move: it is fixed stand'


@pytest.mark.slow
@pytest.mark.parametrize(
    ('fields', 'end'),
    [
        *itertools.product([{'goals': (GOAL,)}], ('key', 'velocity', 'pause', 'reset')),
        *itertools.product([{'explore': True}], ('key', 'reset')),
    ],
)
def test_what_waits_for_the_pose_is_cancelled_by_whatever_cancels_a_goal(
    session_of, monkeypatch, fields, end
):
    session = session_of(**fields)
    navigates = navigation(session)
    monkeypatch.setattr(Navigator, 'is_placed', False)
    session.simulation.advance(400)
    act(session, end)
    monkeypatch.undo()
    session.simulation.advance(1000)
    assert navigates.navigator.goal is None
    assert not navigates.unit.is_exploring
    assert [goal['state'] for goal in navigates.report()['goals']] == ['cancelled'] * len(
        fields.get('goals', ())
    )


@pytest.mark.slow
def test_a_goal_that_never_began_since_the_map_does_not_find_the_place_says_that(
    session_of, monkeypatch
):
    session = session_of(goals=(GOAL,))
    monkeypatch.setattr(Navigator, 'is_placed', False)
    session.simulation.advance(400)
    navigation(session).close()
    why = 'it never began: the robot does not know yet where it is'
    assert ended(session) == ('failed', why)


@pytest.mark.slow
def test_a_goal_waits_for_the_keys_that_make_a_go2_follow_velocities_and_says_if_none_came(
    session_of,
):
    dog = session_of('go2', preset='unitree', goals=(GOAL,))
    dog.press('2')
    dog.simulation.advance(100)
    navigation(dog).close()
    (goal,) = navigation(dog).report()['goals']
    assert goal['state'] == 'failed'
    assert goal['reason'].startswith('it never began: ')


@pytest.mark.slow
def test_exploring_of_the_command_line_says_what_it_waits_for(session_of):
    line = 'maps: exploring waits: press 2 to stand, then 5 to move; any key takes over'
    dog = session_of('go2', preset='unitree', explore=True)
    assert navigation(dog).first_line == line
    dog.simulation.advance(500)
    assert not navigation(dog).unit.is_exploring


@pytest.mark.slow
def test_a_goal_that_does_not_wait_says_no_such_thing(session_of):
    assert 'waits' not in navigation(session_of(goals=(GOAL,))).first_line


@pytest.mark.slow
def test_a_report_tells_where_it_ended(session_of):
    session = session_of(goals=(GOAL,))
    navigation(session).navigator.pilot.end = ('arrived', '')
    session.simulation.advance(1000)
    told = session.report()['navigation']
    (goal,) = told['goals']
    assert goal['goal'] == list(GOAL)
    assert goal['state'] == told['state'] == 'arrived'
    assert goal['truth'][0] == pytest.approx(goal['pose'][0], abs=0.01)
    # It began with the first scan: a revolution but for what is blind.
    first = 6.0 / (2.0 * math.pi) / 5.5
    assert goal['t'] == pytest.approx(first + goal['took'], abs=0.051)


@pytest.fixture
def read():
    """Return a function that reads the options of `wasd mbot`, or of `wasd both`."""

    def read(*words, both=False):
        parser = argparse.ArgumentParser()
        add_run_options(parser, 'both' if both else 'mbot')
        return read_options(parser.parse_args(words))

    return read


def test_goals_and_a_name_to_save_ask_for_a_map(read):
    assert read().map is None
    for words in (('--map',), ('--goal', '1 2'), ('--save-map', 'house')):
        assert read(*words).map == ''
    (goal,) = read('--goal', '1 -2.5').goals
    assert goal[:2] == (1.0, -2.5)
    assert math.isnan(goal[2])
    assert read('--goal', '1 2 3', '--goal', '4 5').goals[0] == (1.0, 2.0, 3.0)
    assert read('--save-map', 'house.yaml').save_map == 'house'


def test_a_patrol_needs_goals(read):
    with pytest.raises(UserError, match='--patrol goes round by goals'):
        read('--patrol')
    assert read('--patrol', '--goal', '1 2').patrol


def test_a_session_goes_on_in_a_map_that_is_named(read, tmp_path):
    saved = tmp_path / 'house.yaml'
    saved.touch()
    with pytest.raises(UserError, match=r'--continue goes on with a map: wanted --map FILE.yaml'):
        read('--map', '--continue')
    with pytest.raises(UserError, match='--continue it'):
        read('--map', str(saved), '--explore')
    assert read('--map', str(saved), '--explore', '--continue').continues
    # What it goes on with may be written over; what it only reads may not.
    assert read('--map', str(saved), '--continue', '--save-map', str(saved)).save_map
    with pytest.raises(UserError, match='the same file'):
        read('--map', str(saved), '--save-map', str(saved))


@pytest.mark.parametrize('plan', ['plan.pgm,0.05', 'plan.yaml'])
@pytest.mark.parametrize('option', ['--world', '--keepout'])
def test_no_output_takes_the_place_of_a_plan_s_picture(read, tmp_path, plan, option):
    (tmp_path / 'plan.pgm').write_bytes(b'P5\n9 9\n255\n' + bytes(81))
    said = 'image: plan.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n'
    (tmp_path / 'plan.yaml').write_text(said)
    words = option, str(tmp_path / plan)
    for output in (
        ('--save-map', str(tmp_path / 'plan')),
        ('--report', str(tmp_path / 'plan.pgm')),
    ):
        with pytest.raises(UserError, match='the same file'):
            read(*words, *output)


@pytest.mark.parametrize('words', ['1', '1 2 3 4', 'a b', '1 nan', ''])
def test_a_goal_that_is_none_is_refused_in_one_line(read, words):
    with pytest.raises(UserError, match=r"--goal: got .*, wanted 'X Y' or 'X Y YAW'"):
        read('--goal', words)


def test_a_map_that_is_not_there_and_one_for_two_robots_are_refused(read, tmp_path):
    with pytest.raises(UserError, match='--map nowhere.yaml: no such file'):
        read('--map', 'nowhere.yaml')
    with pytest.raises(UserError, match='--map /: not a file'):
        read('--map', '/')
    assert read('--map', both=True).map is not None
    (tmp_path / 'house.yaml').touch()
    with pytest.raises(UserError, match='for one robot'):
        read('--map', str(tmp_path / 'house.yaml'), both=True)


@for_all('word', ['--goal', '--patrol', '--save-map', '--keepout', '--continue'])
def test_two_robots_have_no_option_that_could_only_be_refused(word):
    assert word in [option.word for option in options_of('mbot')]
    assert word not in [option.word for option in options_of('both')]


def test_a_place_that_cannot_take_the_map_is_refused_before_the_run(read, tmp_path):
    with pytest.raises(UserError, match='--save-map .*no/dir/x.*wanted a file in a folder'):
        read('--save-map', str(tmp_path / 'no' / 'dir' / 'x'))
    house = tmp_path / 'house.yaml'
    house.write_text('')
    with pytest.raises(UserError, match=r'--map .*--save-map|--save-map .*--map'):
        read('--map', str(house), '--save-map', str(tmp_path / 'house'))


@pytest.mark.slow
def test_a_robot_without_a_lidar_is_refused(session_of):
    with pytest.raises(UserError, match='no planar lidar'):
        session_of(description='mbot_bare')


@pytest.mark.slow
def test_the_footprint_is_what_collides(session_of):
    footprint = navigation(session_of()).unit.settings.footprint
    assert footprint.radius == pytest.approx(0.2112, abs=1e-3)
    dog = navigation(session_of('go2', preset='unitree')).unit.settings
    assert dog.footprint.half_length == pytest.approx(0.34, abs=0.02)
    assert dog.footprint.half_width == pytest.approx(0.16, abs=0.02)
    assert dog.limits.lateral == 0.3
    assert np.isfinite([dog.limits.forward, dog.limits.yaw]).all()


def test_a_goal_that_was_no_place_is_told_at_the_end():
    goals = [
        {'goal': [1.5, -6e-97, None], 'state': 'failed', 'reason': 'no way'},
        {'goal': [None, None, None], 'state': 'refused', 'reason': "wanted a pose in 'map'"},
    ]
    lines = list(_missed_goals({'navigation': {'goals': goals}}))
    assert lines == ['goal 1.5 0 failed: no way', "goal refused: wanted a pose in 'map'"]
    again = {'goal': [1.5, 0.0, None], 'state': 'failed', 'reason': 'a box'}
    lines = list(_missed_goals({'navigation': {'goals': [*goals, again, again]}}))
    assert lines[0] == 'goal 1.5 0 failed: a box (3 times)'
    assert len(lines) == 2
