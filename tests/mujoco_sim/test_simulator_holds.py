# SPDX-License-Identifier: Apache-2.0
"""Physics waits for a controller of another process that answers, and for no other."""

from mujoco_sim.answer_hold import PATIENCE
from mujoco_sim.answer_hold import STATES_AHEAD
from mujoco_sim.conversions import to_joint_commands
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.world import JointCommand
import numpy as np
import pytest

STATE_STEPS = 20  # physics steps between two states at the usual 50 Hz


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


def test_a_controller_that_has_gone_is_waited_for_no_longer(node, monkeypatch):
    now = [100.0]
    monkeypatch.setattr('mujoco_sim.answer_hold.time.monotonic', lambda: now[0])
    answer(node, node.stamp)
    node.simulation.advance(STATES_AHEAD * STATE_STEPS + 1)
    assert not node.may_advance()
    now[0] += PATIENCE + 0.01
    assert node.may_advance()


def test_commands_without_a_simulated_stamp_hold_nothing(node):
    stamp = node.stamp
    stamp.sec += 1_700_000_000  # wall time
    answer(node, stamp)
    node.simulation.advance(4 * STATE_STEPS)
    assert node.may_advance()
