# SPDX-License-Identifier: Apache-2.0
"""The node `gamepad` with a pad of a pipe: held, a button drives; let go or lost, it stops."""

from geometry_msgs.msg import Twist
from pads import PipePad
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from teleop_keyboard.gamepad import JoyToTwist, JoyTwist
from teleop_keyboard.gamepad_node import from_joy, GamepadNode, PadOutput
from teleop_keyboard.parameters import PAD_PRESETS, PadParameters
from wasd_core.errors import UserError

pytestmark = pytest.mark.slow

L1, B, START = 4, 1, 7


@pytest.fixture
def pipe(tmp_path):
    pipe = PipePad(tmp_path / 'pad')
    yield pipe
    pipe.unplug()


class Taker:
    """Takes what a node in lock-step gives."""

    def __init__(self):
        self.velocities, self.keys, self.words = [], [], []
        self.output = PadOutput(self.velocities.append, self.keys.append, self.words.append)


@pytest.fixture
def taker():
    return Taker()


@pytest.fixture
def node(spawn, pipe, taker):
    """A node whose pad is plugged in, looked at by the test."""
    values = {'device': str(pipe.path), 'preset': 'go2'}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    node = spawn(GamepadNode(output=taker.output, parameter_overrides=overrides))
    node.look()
    pipe.plug()
    node.look()
    taker.velocities.clear()  # the first state of all is a zero
    return node


def drive(node, pipe):
    pipe.press(L1)
    pipe.push(1, -1.0)
    node.look()


def test_held_the_dead_man_button_drives_and_let_go_the_next_look_is_a_zero(node, pipe, taker):
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.6)
    assert node.is_enabled
    pipe.release(L1)
    node.look()
    assert taker.velocities[-1] == JoyTwist()
    assert not node.is_enabled
    count = len(taker.velocities)
    pipe.push(1, -0.5)
    node.look()
    assert len(taker.velocities) == count


def test_a_pad_that_is_unplugged_is_a_zero_at_the_next_look(node, pipe, taker):
    drive(node, pipe)
    pipe.unplug()
    node.look()
    assert taker.velocities[-1] == JoyTwist()
    assert taker.words[-1] == 'gamepad lost: stopped'
    assert not node.is_enabled


def test_what_is_held_over_a_disarm_drives_after_it_was_let_go(node, pipe, taker):
    drive(node, pipe)
    node.disarm()
    assert taker.velocities[-1] == JoyTwist()
    count = len(taker.velocities)
    pipe.push(1, -0.9)
    node.look()
    assert len(taker.velocities) == count
    pipe.release(L1)
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.6)


def test_the_button_that_stops_lets_go_of_what_is_held_and_joy_ends_with_that(
    node, spawn, spin_until, pipe, taker
):
    peer, told = spawn(rclpy.create_node('peer')), []
    peer.create_subscription(Joy, 'joy', told.append, 10)
    spin_until(spawn.pump, lambda: node.count_subscribers('joy') > 1)
    node.take_preset('mbot')
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.3)
    pipe.press(B)
    pipe.push(1, -0.9)  # before the next look
    node.look()
    assert taker.velocities[-1] == JoyTwist()
    assert taker.keys == ['STOP']
    spin_until(spawn.pump, lambda: any(message.buttons[B] for message in told))
    spin_until(spawn.pump, lambda: not any(told[-1].buttons))
    assert told[-2].buttons[B]
    pipe.press(L1)
    node.look()
    assert taker.velocities[-1] == JoyTwist()
    pipe.release(L1)
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.3)


def test_what_is_held_on_a_pad_of_another_machine_over_a_disarm_drives_after_it_was_let_go(
    spawn, taker, tmp_path
):
    overrides = [Parameter('device', value=str(tmp_path / 'none'))]
    node = spawn(GamepadNode(output=taker.output, parameter_overrides=overrides))
    held, free = (Joy(axes=[0.0, 1.0], buttons=[0, 0, 0, 0, down]) for down in (1, 0))
    node.joy._callback(free)
    taker.velocities.clear()
    node.joy._callback(held)
    assert taker.velocities == [JoyTwist(vx=0.3)]
    node.disarm()
    for _ in range(3):
        node.joy._callback(held)
    assert taker.velocities == [JoyTwist(vx=0.3), JoyTwist()]
    node.joy._callback(free)
    node.joy._callback(held)
    assert taker.velocities[-1] == JoyTwist(vx=0.3)


def test_without_a_dead_man_button_a_stick_held_over_a_disarm_drives_after_it_was_at_rest(
    node, pipe, taker
):
    node.set_parameters([Parameter('require_enable_button', value=False)])
    pipe.push(1, -1.0)
    node.look()
    assert taker.velocities[-1] == JoyTwist(vx=0.6)
    node.disarm()
    assert taker.velocities[-1] == JoyTwist()
    pipe.push(1, -0.9)
    node.look()
    assert taker.velocities[-1] == JoyTwist()
    pipe.push(1, 0.0)
    node.look()
    pipe.push(1, -1.0)
    node.look()
    assert taker.velocities[-1] == JoyTwist(vx=0.6)


def test_a_pad_that_tells_only_changes_drives_with_the_first_press_after_a_disarm(
    node, pipe, taker
):
    node.set_parameters([Parameter('autorepeat_rate', value=0.0)])
    node.disarm()
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.6)


def test_buttons_press_keys_once_a_press(node, pipe, taker):
    pipe.press(START)
    for _ in range(5):
        node.look()
    pipe.release(START)
    node.look()
    assert taker.keys == ['5']


def test_the_driver_is_told_what_to_hold(node, pipe, taker):
    assert taker.words == [f'gamepad {pipe.path}: hold button 4 to drive']


def test_other_meanings_begin_with_a_stop(node, pipe, taker):
    drive(node, pipe)
    node.take_preset('mbot')
    assert taker.velocities[-1] == JoyTwist()
    pipe.release(L1)
    drive(node, pipe)
    assert taker.velocities[-1] == JoyTwist(vx=0.3)


def test_what_is_published_as_joy_means_the_same_when_it_is_played_again(node, pipe, taker):
    bag, publish = [], node._joy.publish
    node._joy.publish = lambda message: (bag.append(serialize_message(message)), publish(message))
    for share in (0.1, -0.33, -1.0, 0.77):
        pipe.press(L1)
        pipe.push(1, share)
        pipe.push(3, -share)
        node.look()
        pipe.release(L1)
        node.look()
    again = JoyToTwist(PAD_PRESETS['go2'])
    again.lose()
    messages = [deserialize_message(data, Joy) for data in bag]
    twists = [again.step(from_joy(message)) for message in messages]
    assert [twist for twist in twists if twist is not None] == taker.velocities
    assert len(taker.velocities) >= 8
    assert {message.header.frame_id for message in messages} == {'joy'}
    assert [serialize_message(message) for message in messages] == bag


def test_what_is_given_goes_before_the_preset_which_goes_before_the_defaults(spawn):
    overrides = [Parameter('scale_linear.x', value=0.2), Parameter('keys', value=['X=w'])]
    pad = PadParameters(preset='go2')
    node = spawn(GamepadNode(pad=pad, parameter_overrides=overrides))
    settings = node.logic.parameters
    assert (settings.scale_linear.x, settings.scale_linear.y) == (0.2, 0.3)
    assert settings.keys == ('X=w',)
    node.close()


def test_what_is_given_stays_when_the_preset_changes_and_parameters_tell_what_is_in_force(spawn):
    given = [Parameter('scale_linear.x', value=0.2)]
    node = spawn(GamepadNode(pad=PadParameters(preset='mbot'), parameter_overrides=given))
    node.set_parameters([Parameter('scale_angular.yaw', value=0.5)])
    mine = {'scale_linear.x': 0.2, 'scale_angular.yaw': 0.5}
    for preset in ('go2', 'mbot', 'go2'):
        node.take_preset(preset)
        assert node.logic.parameters == PAD_PRESETS[preset].changed(mine)
        told = node.get_parameter('scale_linear.y').value
        assert told == PAD_PRESETS[preset].scale_linear.y
    node.set_parameters([Parameter('scale_linear.x', value=0.4)])
    wanted = PAD_PRESETS['go2'].changed({**mine, 'scale_linear.x': 0.4})
    assert node.logic.parameters == wanted
    node.close()


def test_a_device_that_is_no_pad_is_refused(ros, tmp_path):
    (tmp_path / 'file').touch()
    with pytest.raises(UserError, match='wanted a device'):
        GamepadNode(parameter_overrides=[Parameter('device', value=str(tmp_path / 'file'))])


@pytest.fixture
def peer(context):
    """The rest of the robot, in a context of its own: hears velocities and keys, sends joy."""
    node = rclpy.create_node('peer', context=context)
    node.twists, node.said = [], []
    node.create_subscription(Twist, 'cmd_vel', node.twists.append, 100)
    node.create_subscription(String, 'keys', lambda m: node.said.append(m.data), 100)
    node.joy = node.create_publisher(Joy, 'joy', 10)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.look = lambda: executor.spin_once(timeout_sec=0.01)
    yield node
    executor.shutdown()
    node.destroy_node()


def test_alone_it_publishes_cmd_vel_and_a_pad_on_another_machine_drives_too(
    peer, spawn, spin_until, pipe
):
    node = spawn(GamepadNode(parameter_overrides=[Parameter('device', value=str(pipe.path))]))
    spin_until(spawn.pump, lambda: peer.joy.get_subscription_count() > 0, step=peer.look)
    spin_until(spawn.pump, pipe.try_plug, step=peer.look)
    pipe.press(L1)
    pipe.push(1, -1.0)
    speeds = lambda: [twist.linear.x for twist in peer.twists]  # noqa: E731
    spin_until(spawn.pump, lambda: 0.3 in speeds(), step=peer.look)
    pipe.unplug()
    spin_until(spawn.pump, lambda: speeds()[-1] == 0.0, step=peer.look)
    joy = Joy(axes=[0.0, 0.5], buttons=[0, 0, 0, 0, 1])
    peer.joy.publish(joy)
    spin_until(spawn.pump, lambda: 0.15 in speeds(), step=peer.look)
    joy.buttons = [0, 1, 0, 0, 0]
    peer.joy.publish(joy)
    spin_until(spawn.pump, lambda: peer.said == ['STOP'], step=peer.look)
    assert speeds()[-1] == 0.0
    node.close()


def test_a_pad_of_another_machine_that_comes_held_drives_after_its_release(spawn, taker):
    node = spawn(GamepadNode(output=taker.output))
    held, free = (Joy(axes=[0.0, 1.0], buttons=[0, 0, 0, 0, down]) for down in (1, 0))
    for _ in range(2):
        for message in (held, held):
            node.joy.hear(message)
            assert not any(map(any, taker.velocities))
        node.joy.hear(free)
        node.joy.hear(held)
        assert taker.velocities[-1].vx > 0.0
        taker.velocities.clear()
        node._heard_at -= 1.0  # it was silent


def test_a_pad_that_tells_changes_alone_drives_by_a_button_held_at_rest(spawn, taker):
    node = spawn(GamepadNode(output=taker.output))
    for axis, down in ((0.0, 0), (0.0, 1), (1.0, 1)):
        node.joy.hear(Joy(axes=[0.0, axis], buttons=[0, 0, 0, 0, down]))
        node._heard_at -= 1.0  # it is silent
    assert taker.velocities[-1].vx > 0.0
