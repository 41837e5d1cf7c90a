# SPDX-License-Identifier: Apache-2.0
"""`--gamepad`: the pad drives the robot in turn, and what is let go, lost or halted stands."""

import time
from types import SimpleNamespace

from pads import PipePad
import pytest
import rclpy
from rclpy.parameter import Parameter
from sensor_msgs.msg import Joy
from terminals import PATIENCE
from wasd_bringup.page.bridge import CockpitBridge
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.ros.pad import PadDriver
from wasd_bringup.run.options import RunOptions
from wasd_cockpit.link import Order, Stick
from wasd_core.node import init_ros

pytestmark = pytest.mark.slow

L1, B, START, L2_AXIS, A = 4, 1, 7, 2, 0


@pytest.fixture
def pipe(tmp_path):
    pipe = PipePad(tmp_path / 'pad')
    yield pipe
    pipe.unplug()


@pytest.fixture
def session_of(isolated_ros, pipe):
    """A function that makes a run with the pad, which is plugged in; nothing runs by itself."""
    sessions = []

    def make(robot, preset, *ros):
        init_ros(ros)
        options = RunOptions(
            robot=robot, description=robot, preset=preset, speed=0.0, gamepad=str(pipe.path)
        )
        sessions.append(make_ros_run(options))
        pipe.plug()
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()
    rclpy.try_shutdown()


def run(session, seconds):
    """Let simulated time pass; the session looks at the pad at once, and every 20 ms."""
    session._poll(0.0)
    for _ in range(round(seconds / 0.02)):
        session.simulation.advance(20)
        session._poll(0.0)


def speed(session):
    """Return the speed ahead [m/s]."""
    return float(session.world.base().planar_velocity[0])


@pytest.mark.parametrize('how', ['let go', 'unplugged', 'halted', 'B', 'ESC', 'e-stop'])
def test_mbot_drives_while_the_button_is_held_and_stands_after(session_of, pipe, how):
    bound = ['--ros-args', '-p', "keys:=['B=ESC']"] if how == 'ESC' else []
    session = session_of('mbot', 'mbot', *bound)
    run(session, 0.1)
    pipe.push(1, -1.0)
    run(session, 0.2)
    assert speed(session) == pytest.approx(0.0, abs=1e-3)
    pipe.press(L1)
    # The pad says nothing new for longer than the controller's watchdog waits.
    run(session, 2.0)
    assert speed(session) == pytest.approx(0.3, abs=0.01)
    if how == 'let go':
        pipe.release(L1)
    elif how == 'unplugged':
        pipe.unplug()
    elif how == 'halted':
        session.stop()
    elif how == 'e-stop':
        bridge = CockpitBridge(session)
        bridge._link.order(Order('e-stop'))
        bridge.step(0.0, 0.0)
        bridge.close()
    else:
        pipe.press(B)
    session._poll(0.0)
    # Commanded in this very look, before any time has passed.
    assert session.robot.drive_unit.controller.target.linear == 0.0
    run(session, 1.5)
    assert speed(session) == pytest.approx(0.0, abs=1e-3)


def test_the_go2_stands_up_walks_and_lets_go_by_unitrees_buttons(session_of, pipe):
    session = session_of('go2', 'unitree')
    run(session, 0.1)
    pipe.push(L2_AXIS, 1.0)
    pipe.press(A)
    run(session, 2.0)
    assert session.robot.state == 'fixed stand'
    pipe.release(A)
    pipe.press(START)
    run(session, 0.3)
    assert session.robot.state == 'move base'
    pipe.press(L1)
    pipe.push(1, -0.9)
    run(session, 1.5)
    assert speed(session) > 0.3
    pipe.unplug()
    run(session, 1.0)
    assert abs(speed(session)) < 0.1
    # A pad that comes back is looked for on wall time, of which simulating takes little.
    deadline = time.monotonic() + PATIENCE
    while not pipe.try_plug():
        assert time.monotonic() < deadline
        run(session, 0.02)
    run(session, 0.02)
    pipe.push(L2_AXIS, 1.0)
    pipe.press(B)
    run(session, 0.1)
    assert session.robot.state == 'passive'


def test_halted_the_stick_of_the_page_is_let_go_in_the_last_word_on_cmd_vel(
    session_of, monkeypatch
):
    session = session_of('mbot', 'mbot')
    bridge = CockpitBridge(session)
    bridge.attach('')
    commanded, drive = [], session.robot.command
    monkeypatch.setattr(
        session.robot, 'command', lambda velocity: (commanded.append(velocity), drive(velocity))
    )
    bridge._link.hold(Stick(forward=1.0))
    bridge.step(0.0, 0.0)
    assert commanded[-1][0] > 0.0
    session.stop()
    assert commanded[-1] == (0.0, 0.0, 0.0)


class Robot:
    """What a pad needs of a robot."""

    def __init__(self, preset):
        self.velocities, self.words = [], []
        self.kind, self.say = SimpleNamespace(pad_preset=preset), self.words.append

    def drive(self, velocity, by):
        """Take a velocity of the pad's."""
        assert by == 'gamepad'
        self.velocities.append(velocity)


def test_the_robot_in_turn_is_driven_by_its_own_preset_and_the_other_is_stopped(ros, pipe):
    robots, active, keys = [Robot('mbot'), Robot('go2')], [0], []
    pad = PadDriver(str(pipe.path), robots, lambda: active[0], keys.append)
    pipe.plug()
    pad.look()
    assert robots[0].velocities == []
    pipe.press(L1)
    pipe.push(0, -1.0)  # to the left, which mbot cannot
    pipe.push(1, -1.0)
    pad.look()
    assert robots[0].velocities[-1] == (0.3, 0.0, 0.0)
    active[0] = 1
    pad.look()
    assert robots[0].velocities[-1] == (0.0, 0.0, 0.0)
    count = len(robots[0].velocities)
    pad.repeat()
    assert robots[1].velocities == []  # held over the switch
    pipe.release(L1)
    pipe.press(L1)
    pipe.push(0, -0.99)
    pipe.push(0, -1.0)
    pad.look()
    pad.repeat()
    assert robots[1].velocities[-1] == (0.0, 0.3, 0.0)
    pipe.press(A)
    pipe.push(L2_AXIS, 1.0)
    pipe.release(A)
    pipe.press(A)
    pad.look()
    assert keys == ['2']
    assert len(robots[0].velocities) == count
    pad.close()
    assert robots[1].velocities[-1] == (0.0, 0.0, 0.0)
    pad.node.destroy_node()


def test_a_pad_of_another_machine_is_not_repeated_for_it_may_be_dead(ros, pipe):
    robot = Robot('mbot')
    pad = PadDriver(str(pipe.path), [robot], lambda: 0, print)
    pad.node.set_parameters([Parameter('autorepeat_rate', value=0.0)])
    pipe.plug()
    pad.look()
    pad.node.joy._callback(Joy(axes=[0.0, 1.0], buttons=[0, 0, 0, 0, 1]))
    pad.look()
    pad.repeat()
    assert robot.velocities == [(0.3, 0.0, 0.0)]
    # Our own is seen to be there.
    pipe.press(L1)
    pipe.push(1, -1.0)
    pad.look()
    driven = len(robot.velocities)
    pad.repeat()
    assert robot.velocities[driven:] == [(0.3, 0.0, 0.0)]
    pad.close()
    pad.node.destroy_node()


def test_before_there_is_a_pad_the_driver_reads_so(ros, tmp_path):
    pad = PadDriver(str(tmp_path / 'js0'), [Robot('go2')], lambda: 0, print)
    assert pad.first_line.startswith('gamepad (none is there yet): L2+A stands, START')
    pad.close()
    pad.node.destroy_node()
