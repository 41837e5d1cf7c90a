# SPDX-License-Identifier: Apache-2.0
"""The policy player moves a robot that it knows by topics only, as a node of its own."""

import re

from geometry_msgs.msg import Twist
import numpy as np
from policy_files import mjlab, onnx
from policy_player.joint_controller import State
from policy_player.policy_player_node import PolicyPlayerNode
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger
from topic_rig import Rig
from wasd_core.errors import UserError
from wasd_core.messages import to_imu, to_joint_state, to_stamp
from wasd_core.paired import Paired
from wasd_core.robot_io import ImuReading, JointStates

pytest.importorskip('onnxruntime')
LEGS = ('FL', 'FR', 'RL', 'RR')
JOINTS = tuple(f'{leg}_{part}_joint' for leg in LEGS for part in ('hip', 'thigh', 'calf'))
THIGHS = [JOINTS.index(f'{leg}_thigh_joint') for leg in LEGS]
# Of a thigh for each m/s that the network is told [rad].
LEAN = 0.4
# Of readings [s]: a network acts 50 times a second.
PERIOD = 0.01


@pytest.fixture
def network(tmp_path):
    """The file of a network that stands, and leans as far as it is told to go ahead."""
    weight = np.zeros((12, 9 + 3 * 12), np.float32)
    weight[THIGHS, 6] = LEAN
    told = mjlab(
        JOINTS,
        default_joint_pos=','.join(['0.0,0.8,-1.5'] * 4),
        joint_stiffness='60',
        joint_damping='2',
        action_scale='1',
    )
    path = tmp_path / 'lean.onnx'
    path.write_bytes(onnx([weight], [np.zeros(12, np.float32)], told))
    return str(path)


def make_node(**values):
    given = [Parameter(name, value=value) for name, value in values.items()]
    return PolicyPlayerNode(parameter_overrides=given)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'description': 'go2'}, "how 'go2' stands is not known"),
        ({'policy': 'nowhere.onnx'}, 'nowhere.onnx'),
        ({'policy_config': 'legged_gym'}, 'policy_config needs a network'),
        ({'policy': 'ours', 'description': 'go2'}, 'linear_velocity.*the leg controller does'),
        ({'policy': 'ours', 'description': 'mbot'}, "how 'mbot' stands is not known"),
        ({'policy': 'ours', 'description': 'g1'}, 'joint FL_hip_joint is not in this robot'),
    ],
)
def test_a_network_or_a_robot_that_does_not_fit_is_said_in_a_line(ros, values, words):
    with pytest.raises(UserError, match=words) as error:
        make_node(**values)
    assert '\n' not in str(error.value)


def test_without_a_network_a_g1_stands_and_refuses_to_walk(ros):
    controller = make_node().controller
    assert len(controller.joints) == 29
    assert controller.refusal('2') == ''
    assert controller.press('p').startswith('give -p policy:=FILE')


@pytest.mark.parametrize('topic', ['joint_states', 'imu/data'])
def test_a_network_refuses_readings_slower_than_its_period_in_a_line(ros, network, capfd, topic):
    """50 Hz are wanted: 60 are enough, 12 are not."""
    node = make_node(description='go2', policy=network)
    zeros = np.zeros(12)
    joints = JointStates(zeros, zeros, zeros)
    imu = ImuReading(np.array((1.0, 0.0, 0.0, 0.0)), np.zeros(3), np.array((0.0, 0.0, 9.81)))

    def feed(begin, seconds, slow):
        for index in range(round(60 * seconds)):
            stamp = to_stamp(begin + index / 60.0)
            if topic == 'joint_states' or index % slow == 0:
                node._on_imu(to_imu(imu, 'base', stamp))
            if topic == 'imu/data' or index % slow == 0:
                node._on_joints(to_joint_state(JOINTS, stamp, *joints))

    feed(0.0, 2.0, 1)
    assert node.controller.press('2') == ''
    feed(2.0, 2.0, 1)
    assert node.controller.press('p') == ''
    feed(4.0, 1.0, 1)
    assert node.controller.state == 'policy'
    capfd.readouterr()
    feed(5.0, 2.0, 5)
    said = capfd.readouterr().err
    assert (
        len(re.findall(rf"{topic} comes at \d+ Hz, wanted 50 \(the network's rate\)", said)) == 1
    )
    assert node.controller.state == 'stand'
    assert node.controller.press('p').startswith(f'{topic} comes at ')
    feed(7.0, 2.0, 1)
    assert node.controller.press('p') == ''
    node.destroy_node()


@pytest.mark.parametrize(('ago', 'counts'), [(5.0, False), (3.0, False), (0.1, True)])
def test_of_a_pause_of_the_simulator_a_velocity_counts_only_if_it_is_new(
    ros, network, ago, counts
):
    node = make_node(description='go2', policy=network)
    zeros = np.zeros(12)
    node._on_joints(to_joint_state(JOINTS, to_stamp(1.0), zeros, zeros, zeros))
    node.controller.state = State.POLICY
    message = Twist()
    message.linear.x = 0.5
    node._cmd_vel.hear(message)
    # The simulator is as if it had been paused.
    node._cmd_vel._steps._lived_at -= 4.2
    node._cmd_vel.came_at -= ago
    node._on_joints(to_joint_state(JOINTS, to_stamp(1.01), zeros, zeros, zeros))
    assert any(node.controller._asked) == counts
    node.destroy_node()


@pytest.fixture
def rig(network, spawn, spin_until):
    """A Go2 that lies."""
    made = Rig(spawn, spin_until, PolicyPlayerNode, 'go2', period=PERIOD, policy=network)
    made.run(0.1)
    return made


def press(rig, key, state):
    rig.peer.press(key)
    rig.wait_until(lambda: rig.node.controller.state == state)


def stand(rig):
    """Stand up, and let the network stand."""
    press(rig, '2', 'stand')
    rig.run(2.0)
    assert rig.world.base().position[2] > 0.25
    press(rig, 'p', 'policy')
    rig.run(0.5)


def lean(rig):
    """Return the mean angle of the thighs beyond the pose of the stand [rad]."""
    joints, _ = rig.world.read()
    names = rig.world.parts.joint_names
    return np.mean([joints.position[names.index(JOINTS[k])] for k in THIGHS]) - 0.8


@pytest.mark.slow
def test_the_network_is_told_the_velocity_as_long_as_somebody_says_it(rig):
    stand(rig)
    upright = lean(rig)
    for _ in range(10):
        asked = rig.node.controller._asked
        rig.peer.drive(0.5)
        rig.wait_until(lambda asked=asked: rig.node.controller._asked is not asked)
        rig.run(0.1)
    assert lean(rig) - upright == pytest.approx(0.5 * LEAN, abs=0.1)
    rig.run(1.5)  # nobody says a word
    assert lean(rig) == pytest.approx(upright, abs=0.03)
    # Half a second passes also where readings come slowly.
    controller, asked = rig.node.controller, rig.node.controller._asked
    rig.peer.drive(0.5)
    rig.wait_until(lambda: controller._asked is not asked)
    joints, imu = rig.world.read()
    slow = Paired(0.1, rig.world.joint_names, joints, imu, None)
    for _ in range(6):
        rig.node._step(slow, lambda command: None)
    assert controller.state == 'policy'
    assert not controller._age.is_alive
    press(rig, '1', 'passive')
    rig.run(1.5)
    assert rig.world.base().position[2] < 0.2
    rig.wait_until(lambda: rig.peer.states == ['passive', 'stand', 'policy', 'passive'])


@pytest.mark.slow
def test_it_ignores_what_is_no_number_and_lets_go_at_an_e_stop_and_without_readings(rig):
    stand(rig)
    message = Twist()
    message.linear.x = float('nan')
    rig.peer.cmd_vel.publish(message)
    rig.run(0.3)
    assert rig.node.controller.state == 'policy'
    client = rig.peer.create_client(Trigger, 'policy_player/e_stop')
    answer = client.call_async(Trigger.Request())
    rig.wait_until(answer.done)
    assert answer.result().success
    assert rig.node.controller.state == 'passive'
    rig.run(1.0)
    assert rig.world.base().position[2] < 0.2
    stand(rig)
    rig.simulator.simulation.advance(400)  # readings cease for a while
    rig.wait_until(lambda: rig.node.controller.state == 'passive')
    answer = hoist(rig, False)
    assert not answer.success
    assert answer.message == 'there is no hoist: start the simulator with hoist:=true'


def hoist(rig, holds):
    """Ask for the hoist by the simulator's service; return the answer."""
    client = rig.peer.create_client(SetBool, '/simulator/hoist')
    answer = client.call_async(SetBool.Request(data=holds))
    rig.wait_until(answer.done)
    return answer.result()


@pytest.mark.slow
def test_node_by_node_a_g1_hangs_on_the_hoist_until_it_stands_and_is_raised_again(
    spawn, spin_until
):
    rig = Rig(spawn, spin_until, PolicyPlayerNode, 'g1', {'hoist': True}, PERIOD)
    start = rig.world.base().position[2]
    rig.run(0.6)  # limp
    assert rig.world.base().tilt < 0.1
    press(rig, '2', 'stand')
    rig.run(1.0)
    assert hoist(rig, False).message == 'the hoist has let go'
    rig.run(1.5)
    assert rig.world.base().tilt < 0.1
    assert rig.world.base().position[2] > start - 0.1
    press(rig, '1', 'passive')
    rig.run(1.2)
    assert rig.world.base().position[2] < start - 0.3
    assert hoist(rig, True).message == 'the hoist holds it'
    rig.run(4.0)
    assert rig.world.base().tilt < 0.1
    assert rig.world.base().position[2] > start - 0.05
