# SPDX-License-Identifier: Apache-2.0
"""Physics waits for a controller of another process that answers, and for no other."""

from mujoco_sim.simulation import LONGEST_LOOK, PATIENCE, STATES_AHEAD, STEADY
from mujoco_sim.simulator_node import SimulatorNode
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import to_joint_commands
from wasd_core.robot_io import JointCommand
from wasd_core.topics import SENSOR_DATA

pytestmark = pytest.mark.slow

STATE_STEPS = 10  # physics steps between two states at the usual 100 Hz


@pytest.fixture
def node(spawn):
    """Return a simulator that has run for a tenth of a second."""
    node = spawn(SimulatorNode())
    node.schedule_publishing()
    node.simulation.advance(5 * STATE_STEPS)
    return node


def answer(node, stamp):
    zeros = np.zeros(2)
    command = JointCommand(zeros, zeros, zeros, zeros, np.full(2, 0.3))
    node._on_command(to_joint_commands(node._world.motor_names, command, stamp))


def test_without_a_controller_physics_goes_on(node):
    assert node.may_advance()


def test_physics_stays_within_a_few_states_of_a_controller_that_answers(node):
    answer(node, node.stamp)
    node.simulation.advance(STATES_AHEAD * STATE_STEPS)
    assert node.may_advance()
    node.simulation.advance(1)
    assert not node.may_advance()
    answer(node, node.stamp)
    assert node.may_advance()


def hold(node, now, duration):
    """Look whether physics may go on, often, for a duration [s]; return for how long not."""
    for count in range(round(duration / LONGEST_LOOK)):
        if node.may_advance():
            return count * LONGEST_LOOK
        now[0] += LONGEST_LOOK
    return duration


@pytest.fixture
def now(monkeypatch):
    """Return wall time in a list, to be changed."""
    now = [100.0]
    monkeypatch.setattr('mujoco_sim.simulation.time.monotonic', lambda: now[0])
    return now


@pytest.fixture
def controller(node, spawn, spin_until):
    """Return a node that publishes joint_commands."""
    controller = spawn(Node('controller'))
    controller.create_publisher(JointTrajectory, 'joint_commands', 10)
    spin_until(spawn.pump, lambda: node.count_publishers('joint_commands'))
    return controller


def answer_steadily(node):
    for _ in range(STEADY):
        answer(node, node.stamp)
        node.simulation.advance(STATE_STEPS)
    node.simulation.advance(STATES_AHEAD * STATE_STEPS)


def test_a_controller_that_was_answering_and_is_there_is_waited_for(node, now, controller):
    answer_steadily(node)
    assert hold(node, now, 20.0) == pytest.approx(node.settings.answer_patience, abs=0.15)
    assert node.state == 'running'
    # It is not waited for again until it answers, and then not as long at first.
    assert hold(node, now, 1.0) == 0.0
    answer(node, node.stamp)
    node.simulation.advance(STATES_AHEAD * STATE_STEPS + 1)
    assert hold(node, now, 20.0) == pytest.approx(PATIENCE, abs=0.15)
    answer_steadily(node)
    assert hold(node, now, 3.0) == 3.0
    assert node.state == 'waiting for joint_commands'


def test_a_state_that_is_waited_for_is_told_again_as_it_was(node, controller, spawn, spin_until):
    heard = []
    controller.create_subscription(JointState, 'joint_states', heard.append, SENSOR_DATA)
    bases = []
    controller.create_subscription(Odometry, 'ground_truth/odom', bases.append, SENSOR_DATA)
    spin_until(
        spawn.pump,
        lambda: (
            node._joint_states.get_subscription_count()
            and node.truth._truth.get_subscription_count()
        ),
    )
    answer_steadily(node)
    asked = node.stamp
    node.simulation.advance(1)
    spin_until(spawn.pump, lambda: heard and heard[-1].header.stamp == asked)
    last = heard[-1]
    heard.clear()
    may = []
    spin_until(spawn.pump, lambda: len(heard) >= 3, step=lambda: may.append(node.may_advance()))
    assert not any(may)
    assert all(again == last for again in heard)
    assert bases[-1].header.stamp == asked
    answer(node, node.stamp)
    assert node.may_advance()
    assert not node._hold.repeats()


def test_a_controller_that_has_gone_is_waited_for_no_longer(node, now):
    answer_steadily(node)  # nobody publishes joint_commands any more
    assert hold(node, now, 20.0) == pytest.approx(PATIENCE, abs=0.15)


def test_a_simulator_that_was_stopped_itself_has_not_waited_meanwhile(node, now, controller):
    answer_steadily(node)
    assert not node.may_advance()
    now[0] += 60.0
    assert not node.may_advance()


def test_who_commands_now_and_then_is_not_waited_for(node, now, controller):
    answer(node, node.stamp)
    node.simulation.advance(STATES_AHEAD * STATE_STEPS + 1)
    assert hold(node, now, 20.0) == pytest.approx(PATIENCE, abs=0.15)


def test_commands_without_a_simulated_stamp_hold_nothing(node):
    stamp = node.stamp
    stamp.sec += 1_700_000_000  # wall time
    answer(node, stamp)
    node.simulation.advance(4 * STATE_STEPS)
    assert node.may_advance()
