# SPDX-License-Identifier: Apache-2.0
"""Messages are made when there is somebody to get them; what moves does not depend on that."""

from descriptions import robot_named
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.world import build_world
import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState

from mujoco_sim import simulator_node, truth_publisher

pytestmark = pytest.mark.slow

PARTS = (
    (simulator_node, 'to_joint_state'),
    (truth_publisher, 'to_ground_truth'),
    (simulator_node, 'to_imu'),
)


@pytest.fixture(scope='module')
def go2():
    return robot_named('go2')


def simulate(spawn, go2, steps=100):
    """Return the last reading of a Go2 with noise, and its simulator."""
    world = build_world(go2, setup=usual_setup(go2))
    node = spawn(SimulatorNode(go2, world))
    node.schedule_publishing()
    for _ in range(steps // 10):
        node.simulation.advance(10)
        spawn.pump.handle()
    return world.read(), node


def test_without_listeners_no_message_is_made(spawn, go2, monkeypatch):
    for module, part in PARTS:
        monkeypatch.setattr(module, part, lambda *_, **__: pytest.fail('nobody listens'))
    simulate(spawn, go2)


def test_noise_does_not_depend_on_who_listens(spawn, go2, spin_until):
    alone, node = simulate(spawn, go2)
    listener = spawn(Node('listener'))
    received = []
    listener.create_subscription(JointState, 'joint_states', received.append, 10)
    spin_until(spawn.pump, lambda: node._joint_states.get_subscription_count() > 0)
    heard, _ = simulate(spawn, go2)
    spin_until(spawn.pump, lambda: len(received) >= 2)
    np.testing.assert_array_equal(heard.joints.position, alone.joints.position)
    np.testing.assert_array_equal(heard.imu.linear_acceleration, alone.imu.linear_acceleration)
