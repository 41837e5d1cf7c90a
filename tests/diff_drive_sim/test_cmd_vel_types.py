# SPDX-License-Identifier: Apache-2.0
"""cmd_vel as Twist and TwistStamped, from other processes' participants."""

import time

from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from geometry_msgs.msg import Twist, TwistStamped
import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

pytestmark = pytest.mark.slow


@pytest.fixture
def publish(ros):
    """Return a function that publishes a velocity from a participant of its own."""
    contexts, nodes, publishers = [], [], {}

    def publish(message):
        kind = type(message)
        if kind not in publishers:
            context = Context()
            context.init()
            node = rclpy.create_node(f'sender_{len(nodes)}', context=context)
            contexts.append(context)
            nodes.append(node)
            publishers[kind] = node.create_publisher(kind, 'cmd_vel', 10)
        publishers[kind].publish(message)
        time.sleep(0.01)  # no flood: they take turns on a busy machine

    yield publish
    for node, context in zip(nodes, contexts, strict=True):
        node.destroy_node()
        context.try_shutdown()


def plain(linear):
    message = Twist()
    message.linear.x = linear
    return message


def stamped(linear, stamp=None):
    message = TwistStamped()
    message.twist.linear.x = linear
    if stamp is not None:
        message.header.stamp = stamp
    return message


@pytest.fixture
def make(spawn, mbot):
    """Return a function that makes the face of a drive with parameters."""

    def make(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return spawn(DiffDriveControllerNode(DiffDrive(mbot), parameter_overrides=overrides))

    return make


@pytest.mark.parametrize(('wanted', 'deaf'), [(True, plain), (False, stamped)])
def test_one_type_can_be_asked_for(make, publish, spawn, spin_until, wanted, deaf):
    node, taken = make(stamped=wanted), []
    heard = stamped if wanted else plain
    take = node.cmd_vel.on_velocity
    node.cmd_vel.on_velocity = lambda velocity, age: (
        taken.append(velocity[0]),
        take(velocity, age),
    )
    spin_until(
        spawn.pump,
        lambda: node.controller.target.linear == 0.2,
        step=lambda: (publish(deaf(0.1)), publish(heard(0.2))),
    )
    assert set(taken) == {0.2}


def test_an_old_command_is_dropped_and_one_without_a_stamp_is_of_now(make, capfd):
    node = make(stamped=True)
    node.cmd_vel.hear(stamped(0.2))
    node.cmd_vel.hear(stamped(0.1))
    assert node.controller.target.linear == 0.1
    old = node.get_clock().now() - rclpy.duration.Duration(seconds=0.7)
    node.cmd_vel.hear(stamped(0.3, old.to_msg()))
    assert node.controller.target.linear == 0.1
    said = capfd.readouterr().err
    assert said.count('has no stamp: taken as of now') == 1
    assert 's old, more than cmd_vel_timeout 0.5 s: dropped' in said


def test_a_command_that_took_its_time_times_out_sooner(make):
    node = make(stamped=True)
    stamp = node.get_clock().now() - rclpy.duration.Duration(seconds=0.3)
    node.cmd_vel.hear(stamped(0.3, stamp.to_msg()))
    steps = 0
    while node.controller.target.linear:
        node.unit.control(0.0, 0.0, 0.005)
        steps += 1
    # 0.3 of 0.5 s were over, and what this machine took since.
    assert 0 < steps <= 41  # the last one sees that it is over
