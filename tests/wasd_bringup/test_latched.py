# SPDX-License-Identifier: Apache-2.0
"""`--latched`: after an e-stop from anywhere nothing moves the robot before it is released."""

import itertools
import math
import os
from pathlib import Path
import re
import time
from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
import numpy as np
import pytest
from rclpy.node import Node
from std_msgs.msg import Bool, String
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_script import KeyPress
from teleop_keyboard.terminal import Source
from terminals import PATIENCE
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.ros.foxglove_inbox import Inbox, Target
from wasd_bringup.run.drivers import SILENCE
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.robot import SINCE
from wasd_bringup.run.run import Run
from wasd_core.topics import EVENTS

pytestmark = pytest.mark.slow

# How each robot is got to move: keys and when they are pressed [s], and how long it moves [s].
MOVES = {
    'mbot': ('mbot', 'mbot', [], 1.2),
    'go2 trots': ('go2', 'unitree', [(0.0, '2'), (1.2, '4'), *[(1.4, 'w')] * 8], 2.2),
}
DOCS = Path(__file__).parents[2] / 'docs/drivers.md'
# How it is stopped, by a run and the face of its robot.
ORIGINS = {
    'key': lambda run, face: run.press('ESC'),
    'key on the page': lambda run, face: run.press('ESC', 'page'),
    'page': lambda run, face: run.e_stop('page'),
    'script': lambda run, face: run.press('ESC', 'script'),
    'client of Foxglove': lambda run, face: face.robot.press('ESC', 'foxglove 1'),
    'topic e_stop': lambda run, face: face.drivers._on_topic(Bool(data=True)),
    'topic keys': lambda run, face: face.controller.key_inputs[0].hear(String(data='ESC')),
    'service': lambda run, face: face.drivers._on_stop(),
}
LEGS_SERVICE = 'service of the legs'
VELOCITY = (0.3, 0.0, 0.3)


def twist():
    """Return a velocity of another process, which is no echo of ours."""
    message = Twist()
    message.linear.x, message.angular.z = 0.31, 0.32
    return message


class Held:
    """A run in which every source holds what moves the robot, and goes on holding it."""

    def __init__(self, move, latched=True):
        robot, preset, self._keys, self._moves = MOVES[move]
        self.session = make_ros_run(
            RunOptions(
                robot=robot,
                description=robot,
                preset=preset,
                speed=0.0,
                latched=latched,
            )
        )
        self.robot = self.session.robot
        # A state's key ends what moves the robot in the state before it.
        self._motion_keys = '2', '4', '5', {'mbot': 'i', 'unitree': 'w'}[preset]
        self.face = self.session.face.faces[0]

    def begin(self):
        """Get it to drive, by its keys and then by all others."""
        start = self.session.world.time
        for when, key in self._keys:
            self.run(when - (self.session.world.time - start), holds=False)
            self.session.press(key)
        self.run(self._moves)

    def hold(self):
        """Send what each source sends while it holds."""
        for source in ('page', 'gamepad', 'foxglove 1', 'script', 'recording', 'navigator'):
            self.robot.drive(VELOCITY, source)
        for key in self._motion_keys:
            for source in ('keys', 'page', 'gamepad', 'foxglove 1', 'script'):
                self.session.press(f'HELD+{key}' if source == 'page' else key, source)
        self.face.controller.node.cmd_vel.hear(twist())
        for subscription in self.face.controller.key_inputs:
            for key in self._motion_keys:
                subscription.hear(String(data=key))

    def run(self, seconds, holds=True):
        for _ in range(round(seconds / 0.05)):
            if holds:
                self.hold()
            self.session.simulation.advance(50)

    def stop(self, origin):
        """Stop it from somewhere; return what a service answers."""
        if origin == LEGS_SERVICE:
            return self.face.controller.node._on_e_stop()
        return ORIGINS[origin](self.session, self.face)

    @property
    def place(self):
        return self.session.world.base().position[:2].copy()


@pytest.fixture
def held_of(ros):
    """A function that makes such a run."""
    runs = []

    def make(*words, **options):
        runs.append(Held(*words, **options))
        return runs[-1]

    yield make
    for run in runs:
        run.session.close()


@pytest.fixture(scope='module')
def undisturbed():
    """Where each move stands after a stop, and after its release, when nobody holds anything."""
    return {}


def places_after_a_stop(run, origin, holds):
    """Get a run to move, stop it and release it; yield where it is after each."""
    before = run.place
    run.begin()
    run.stop(origin)
    assert math.dist(run.place, before) > 0.2
    for release in ('', 'ENTER'):
        run.session.press(release)
        run.run(SILENCE + 0.4, holds=holds)  # what would count again after a silence moves it
        yield run.place.tolist()


@pytest.mark.parametrize(
    ('move', 'origin'),
    [
        *itertools.product(['mbot'], ORIGINS),
        ('go2 trots', LEGS_SERVICE),
    ],
)
def test_until_the_reset_it_moves_as_if_nobody_held_anything_and_so_after_it(
    held_of, undisturbed, move, origin
):
    if move not in undisturbed:
        undisturbed[move] = list(places_after_a_stop(held_of(move), origin, holds=False))
    held = held_of(move)
    places = places_after_a_stop(held, origin, holds=True)
    stopped, released = undisturbed[move]
    # A Go2 that has let go of its legs slides a little as it settles.
    assert next(places) == stopped
    assert held.robot.status().state == 'E-STOP'
    assert 'ENTER' in held.robot.status().message
    assert next(places) == released
    held.run(SILENCE + 0.1, holds=False)  # all let go
    rest = held.place
    held.begin()
    assert math.dist(held.place, rest) > 0.2


@pytest.mark.parametrize('what', ['reset', 'topic false', 'key', 'goal'])
def test_nothing_but_its_release_ends_a_stop_that_holds(held_of, what):
    held = held_of('mbot')
    held.stop('page')
    if what == 'reset':
        held.session.press('BACKSPACE')
    elif what == 'topic false':
        held.face.drivers._on_topic(Bool(data=False))
    elif what == 'key':
        held.session.press(' ')
    else:
        assert held.robot.refusal.startswith('ENTER releases E-STOP')
    place = held.place
    held.run(1.0)
    assert np.allclose(held.place, place, atol=1e-3)


def test_while_a_stop_holds_the_driver_reads_how_it_is_released_and_no_key_to_stand(held_of):
    held = held_of('go2 trots')
    held.begin()
    held.stop('page')
    for _ in range(10):
        status = held.robot.status()
        assert status.state == 'E-STOP'
        assert status.message == 'ENTER releases E-STOP (by the page)'
        held.run(0.1)


def test_a_client_of_foxglove_that_goes_on_is_told_how_it_is_released(held_of):
    held = held_of('mbot')
    inbox = Inbox(lambda sender, data: VELOCITY, lambda sender, data: '')
    inbox.targets = [Target(held.robot, '/cmd_vel', '/keys')]
    client = SimpleNamespace(id=1)
    channel = SimpleNamespace(id=1, topic='/cmd_vel', encoding='cdr', schema_name='')
    inbox.on_client_advertise(client, channel)
    told = []
    for stop in (False, True):
        if stop:
            held.stop('page')
        inbox.on_message_data(client, 1, b'')
        told.append(inbox.step(0.02))
    assert told == [[], ['/cmd_vel: stopped; ENTER releases E-STOP (by the page)']]


@pytest.mark.parametrize(
    ('latched', 'words'),
    [
        (True, 'ENTER releases E-STOP (by the service e_stop)'),
        (False, 'passive; press 2 to stand again'),
    ],
)
def test_who_stops_the_legs_by_their_service_is_told_how_they_move_again(held_of, latched, words):
    held = held_of('go2 trots', latched=latched)
    answer = held.stop(LEGS_SERVICE)
    assert answer == (True, words)


def test_the_service_releases_it(held_of):
    held = held_of('mbot')
    held.stop('service')
    assert held.face.drivers._on_release() == (True, 'released: drive again')
    assert held.face.drivers._on_release() == (True, 'no stop holds')
    place = held.place
    held.run(1.0)
    assert math.dist(held.place, place) > 0.1


def test_without_the_option_a_stop_ends_what_is_held_and_a_new_press_drives(held_of):
    held = held_of('mbot', latched=False)
    held.begin()
    held.stop('page')
    held.run(1.0)
    rest = held.place
    held.run(1.0)
    assert math.dist(held.place, rest) < 1e-3
    held.run(SILENCE + 0.1, holds=False)
    held.begin()
    assert math.dist(held.place, rest) > 0.2


def test_without_the_option_too_the_driver_reads_who_stopped_the_robot(held_of):
    held = held_of('mbot', latched=False)
    held.session.press('HELD+i', 'page')
    told = []
    held.face.drivers._publisher.publish = told.append
    held.stop('topic e_stop')
    assert held.robot.status().message == 'drive again (E-STOP by the topic e_stop)'
    held.session.press('HELD+i', 'page')
    since = '(refused since E-STOP by the topic e_stop)'
    assert held.robot.status().message == f'let go of i {since}'
    held.run(0.1, holds=False)
    assert {pair.key: pair.value for pair in told[-1].values}['last_stop_by'] == 'topic e_stop'
    held.run(SILENCE + 0.1, holds=False)
    assert told[-1].level == DiagnosticStatus.OK
    held.session.press('RELEASE+i', 'page')
    held.session.press('HELD+i', 'page')
    held.run(0.1, holds=False)
    assert {pair.key: pair.value for pair in told[-1].values}['last_stop_by'] == ''
    assert SINCE not in held.robot.status().message


def test_a_driver_of_ones_own_is_one_file(held_of):
    (text,) = re.findall(r'```python\n(.*?)```', DOCS.read_text(), re.DOTALL)
    assert len(text.splitlines()) < 30
    names = {}
    exec(text, names)  # what the page tells a newcomer to write
    session = held_of('mbot', latched=True).session
    session.join(names['Sine'](session.robot))
    session.simulation.advance(700)
    assert session.robot.drivers.state.driver == 'sine'
    assert session.world.base().rpy[2] > 0.2
    session.press('ESC')
    session.simulation.advance(500)
    yaw = session.world.base().rpy[2]
    session.simulation.advance(2000)
    assert session.world.base().rpy[2] == pytest.approx(yaw, abs=1e-3)
    assert session.robot.drivers.state.asks == ('sine',)


KEYMAP = """
speed: 0.5
turn: 1.0
speed_limits: [0.05, 2]
turn_limits: [0.1, 3]
linear_accel: 1.0
angular_accel: 4.0
motion:
  i: [1, 0, 0]
  ESC: [-1, 0, 0]
"""


def test_esc_is_the_e_stop_and_nothing_else_also_where_a_keymap_names_it(tmp_path):
    preset = tmp_path / 'mine.yaml'
    preset.write_text(KEYMAP)
    run = Run(
        RunOptions(robot='mbot', description='mbot', preset=str(preset), speed=0.0, latched=True)
    )
    run.press('i')
    assert run.robot.drivers.state.driver == 'keys'
    run.press('ESC')
    assert run.robot.drivers.stopped_by == 'keys'
    run.end_e_stop()
    run.press('HELD+ESC')  # which is still down
    assert not any(run.robot.drivers.held('keys'))
    run.press('RELEASE+ESC')
    run.press('ESC')
    run.press('RELEASE+i')
    assert not run.robot.press('i', 'keys')
    run.close()


def test_enter_releases_a_stop_also_where_a_keymap_names_it(tmp_path):
    preset = tmp_path / 'mine.yaml'
    preset.write_text(KEYMAP.replace('ESC: [-1, 0, 0]', 'ENTER: [-1, 0, 0]'))
    run = Run(
        RunOptions(robot='mbot', description='mbot', preset=str(preset), speed=0.0, latched=True)
    )
    run.press('ESC')
    assert run.robot.status().message == 'ENTER releases E-STOP (by the keys)'
    run.press('ENTER')
    assert not run.robot.drivers.stopped_by
    assert not any(run.robot.drivers.held('keys'))
    run.press('HELD+ENTER')
    assert not any(run.robot.drivers.held('keys'))
    run.press('RELEASE+ENTER')
    run.press('ENTER')
    assert run.robot.drivers.state.driver == 'keys'
    run.close()


def test_a_key_refused_since_a_stop_tells_how_it_counts_again():
    run = Run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0))
    run.press('i')
    run.robot.take_topic('keys', key='i')
    run.press('ESC')
    for press, how_long in (
        (lambda: run.press('i'), f' for {SILENCE:g} s'),
        (lambda: run.robot.take_topic('keys', key='i'), f' for {SILENCE:g} s'),
        (lambda: run.press('HELD+i'), ''),  # its release is told
    ):
        run.robot.notice.say(None)
        assert not press()
        assert (
            run.robot.status().message
            == f'let go of i{how_long} (refused since E-STOP by the keys)'
        )
    run.press('RELEASE+i')
    run.press('HELD+i')
    assert 'let go' not in run.robot.status().message
    run.close()


@pytest.mark.parametrize(('by', 'goes_on'), [('page', False), ('script', True)])
def test_an_e_stop_ends_a_script_of_keys_unless_it_is_the_script_s_own(by, goes_on):
    # The key counts again after a silence.
    times = [0.1 * n for n in (*range(10), *range(25, 35))]
    keys = tuple(KeyPress(when, 'i') for when in times)
    run = Run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0, keys=keys))
    run.simulation.run(stop=lambda: run.world.time >= 1.0, poll=lambda _: None)
    assert run.robot.drive_unit.controller.target.linear > 0.1
    run.e_stop(by)
    run.simulation.run(stop=lambda: run.world.time >= 3.2, poll=lambda _: None)
    assert (run.robot.drive_unit.controller.target.linear > 0.1) == goes_on
    run.close()


def test_a_velocity_of_a_topic_ends_with_a_pause_and_the_next_one_counts():
    run = Run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0))
    simulation, robot = run.simulation, run.robot

    def drive():
        robot.follow('/cmd_vel', VELOCITY)

    for moment in ('before', 'meanwhile'):

        def poll(timeout, moment=moment):
            if simulation.paused and moment == 'meanwhile':
                drive()
            simulation.paused = False

        if moment == 'before':
            drive()
        simulation.paused = True
        until = robot.world.time + 0.1
        simulation.run(lambda until=until: robot.world.time >= until, poll)
        assert robot.sample().command == (0.0, 0.0, 0.0)
    drive()
    simulation.advance(100)
    assert robot.sample().command == VELOCITY
    run.close()


def test_a_velocity_of_another_source_that_has_taken_over_goes_on_after_a_pause():
    run = Run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0))
    robot = run.robot
    robot.follow('/cmd_vel', VELOCITY)
    robot.drive(VELOCITY, 'navigator')
    for tell in run.simulation.on_resume:
        tell()
    run.simulation.advance(50)
    assert robot.sample().command == VELOCITY
    assert robot.drivers.state.driver == 'navigator'
    run.close()


def test_the_robot_stops_when_the_last_keyboard_of_others_is_gone(ros):
    options = RunOptions(robot='mbot', description='mbot', preset='ramps', speed=0.0)
    run = make_ros_run(options)
    far = Node('keyboard')
    keys = far.create_publisher(String, 'keys', EVENTS)
    controller = run.robot.drive_unit.controller

    def step():
        run.face.handle(0.01)
        run.simulation.advance(20)

    def handle_until(condition):
        until = time.monotonic() + PATIENCE
        while not condition() and time.monotonic() < until:
            step()
        assert condition()

    handle_until(lambda: keys.get_subscription_count() > 0)
    keys.publish(String(data='w'))
    handle_until(lambda: controller.target.linear > 0.1)
    for _ in range(50):
        step()
    assert controller.target.linear > 0.1
    far.destroy_node()
    handle_until(lambda: controller.target.linear == 0.0)
    assert not any(run.robot.drivers.held('topic'))
    run.close()


def test_the_robot_stops_when_the_pipe_of_its_keys_ends_where_others_may_still_drive():
    reading, writing = os.pipe()
    options = RunOptions(
        robot='mbot', description='mbot', preset='ramps', speed=0.0, gamepad='', duration=3.0
    )
    with KeyReader(None, Source(reading)) as reader:
        run = Run(options, reader)
        controller = run.robot.drive_unit.controller
        os.write(writing, b'w')
        run.simulation.run(stop=lambda: run.world.time >= 1.0, poll=run._poll)
        assert controller.target.linear > 0.1
        os.close(writing)
        # Keys are read by wall time, of which a second of this run takes next to nothing.
        deadline = time.monotonic() + PATIENCE
        run.simulation.run(
            stop=lambda: controller.target.linear == 0.0 or time.monotonic() > deadline,
            poll=run._poll,
        )
        assert controller.target.linear == 0.0
        run.close()
