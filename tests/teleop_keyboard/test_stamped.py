# SPDX-License-Identifier: Apache-2.0
"""What a standing robot hears, and which time stamps and ramps follow."""

import time

from builtin_interfaces.msg import Time
import pytest
import rclpy
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.twist_messages import from_twist

pytestmark = pytest.mark.slow


@pytest.fixture
def teleop_of(ros_domain, spawn):
    def make(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return spawn(KeysToTwistNode(parameter_overrides=overrides))

    return make


@pytest.mark.parametrize(
    ('idle', 'before', 'after'), [('silent', 0, 1), ('zeros', 0, 100), ('repeat', 100, 100)]
)
def test_the_idle_policy_says_what_a_standing_robot_hears(ros_domain, spawn, idle, before, after):
    given = [Parameter('idle', value=idle)]
    node = spawn(KeysToTwistNode(KeysToTwist(load_preset('mbot')), parameter_overrides=given))
    sent = []
    node.output.receivers.append(sent.append)

    def wait(seconds):
        sent.clear()
        for _ in range(round(seconds / 0.02)):
            node.step(0.02)
        return len(sent)

    assert wait(2.0) == before
    node.keys.hear(String(data='i'))
    assert wait(0.5) == 25
    node.keys.hear(String(data='k'))
    assert wait(2.0) == after
    assert {from_twist(message) for message in sent} == {STANDSTILL}
    assert wait(2.0) == (0 if idle == 'silent' else after)


def test_stamps_and_ramps_are_simulated_time_and_a_pause_brings_no_burst(
    teleop_of, context, spawn, spin_until
):
    teleop = teleop_of(use_sim_time=True, stamped=True)
    simulator = rclpy.create_node('simulator', context=context)
    clock = simulator.create_publisher(Clock, 'clock', 10)
    sent = []
    teleop.output.receivers.append(sent.append)
    now = Clock()

    def tick_to(nanoseconds):
        now.clock.sec, now.clock.nanosec = divmod(nanoseconds, 10**9)

        def publish():
            clock.publish(now)

        spin_until(
            spawn.pump,
            lambda: teleop.get_clock().now().nanoseconds == nanoseconds,
            step=publish,
        )

    tick_to(10 * 10**9)
    teleop.keys.hear(String(data='i'))
    assert sent[-1].header.stamp.sec == 10
    first = sent[-1].twist.linear.x
    count = len(sent)
    # Time stands still: nothing comes, and nothing has piled up when it goes on.
    for _ in range(50):
        spawn.pump.handle(0.002)
    assert len(sent) == count
    tick_to(10 * 10**9 + 10**8)
    spin_until(spawn.pump, lambda: len(sent) > count)
    assert len(sent) <= count + 3
    assert sent[-1].twist.linear.x == pytest.approx(first + 0.6 * 0.1, abs=1e-9)
    # A clock that jumps is no driving time either, and brings no burst: a key of which nothing
    # was heard for 15 s is no longer down, and the ramp goes on for 0.2 s.
    count = len(sent)
    tick_to(25 * 10**9)
    spin_until(spawn.pump, lambda: len(sent) > count)
    assert len(sent) <= count + 3
    assert sent[count].twist.linear.x == 0.0
    simulator.destroy_node()


def test_at_half_speed_the_ramp_follows_simulated_time(teleop_of, context, spawn, spin_until):
    teleop = teleop_of(use_sim_time=True, stamped=True)
    simulator = rclpy.create_node('simulator', context=context)
    clock = simulator.create_publisher(Clock, 'clock', 10)
    sent = []
    teleop.output.receivers.append(sent.append)
    started = time.monotonic()

    def tick():
        seconds, fraction = divmod(10.0 + 0.5 * (time.monotonic() - started), 1.0)
        clock.publish(Clock(clock=Time(sec=int(seconds), nanosec=int(1e9 * fraction))))

    spin_until(spawn.pump, lambda: teleop.get_clock().now().nanoseconds > 0, step=tick)
    teleop.keys.hear(String(data='j'))

    def step():
        tick()
        time.sleep(0.002)

    spin_until(spawn.pump, lambda: teleop.logic.velocity.wz > 0.8, step=step)
    stamps = [message.header.stamp for message in sent]
    simulated = [stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps]
    turns = [message.twist.angular.z for message in sent]
    gained = turns[-1] - turns[1]
    # mbot's 3 rad/s^2 of simulated time, within the 1 % of the ramp.
    assert gained / (simulated[-1] - simulated[1]) == pytest.approx(3.0, rel=0.01)
    simulator.destroy_node()
