# SPDX-License-Identifier: Apache-2.0
"""Simulator and leg controller, each in a process of its own: they walk, stop and go on."""

from collections.abc import Iterator
import os
import signal
import subprocess
import sys
import time

from nav_msgs.msg import Odometry
import numpy as np
import programs
import pytest
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# Each is made once; 5 times each was measured once: no fall.
STOPS = (0.3, 3.0)
# Slower than real time, so that two processes on a busy machine can keep in step.
SPEED = 0.5


class Watcher(Node):
    """Presses keys, and sees time, state and truth."""

    def __init__(self, pump, processes):
        super().__init__('watcher', start_parameter_services=False)
        pump.add_node(self)
        self._pump, self._processes = pump, processes
        self.now, self.place, self.states = 0.0, None, []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'state', lambda m: self.states.append(m.data), latched)
        self.create_subscription(Odometry, 'ground_truth/odom', self._on_truth, 10)
        self.create_subscription(Clock, '/clock', self._on_clock, 10)
        self._keys = self.create_publisher(String, 'keys', 100)

    def until(self, condition):
        """Handle messages until a condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert all(process.poll() is None for process in self._processes)
            assert time.monotonic() < deadline, (self.now, self.states)
            self._pump.handle(0.02)

    def connect(self):
        """Wait for both processes."""
        self.until(lambda: self.states and self.place is not None)
        self.until(self._keys.get_subscription_count)

    def press(self, key, state):
        """Press a key that leads to a state."""
        self._keys.publish(String(data=key))
        self.until(lambda: self.states[-1] == state)

    def stick(self, key):
        """Press a key that moves a stick."""
        self._keys.publish(String(data=key))

    def pass_time(self, duration):
        """Let simulated time pass [s]."""
        end = self.now + duration
        self.until(lambda: self.now >= end)

    def pass_wall_time(self, duration):
        """Let wall time pass [s]."""
        end = time.monotonic() + duration
        self.until(lambda: time.monotonic() >= end)

    def _on_truth(self, message):
        place = message.pose.pose.position
        self.place = np.array((place.x, place.y, place.z))

    def _on_clock(self, message):
        self.now = message.clock.sec + 1e-9 * message.clock.nanosec


@pytest.fixture
def processes(isolated_ros) -> Iterator[list[subprocess.Popen]]:
    """Start simulator and leg controller, each in a process of its own; end them afterwards."""
    simulator = ('mujoco_sim.simulator_node', '--ros-args', '-p', 'description:=go2')
    commands = (
        (*simulator, '-p', 'state_rate:=500.0', '-p', f'speed:={SPEED}'),
        ('quadruped_sim.leg_controller_node',),
    )
    started = [
        programs.start(
            [sys.executable, '-m', *words], env=os.environ.copy(), start_new_session=True
        )
        for words in commands
    ]
    yield started
    for process in started:
        process.send_signal(signal.SIGCONT)
        process.terminate()
    for process in started:
        process.wait(PATIENCE)


def test_two_processes_walk_and_one_that_stops_or_ends_lets_the_robot_not_fall(spawn, processes):
    watcher = spawn(Watcher(spawn.pump, processes))
    watcher.connect()
    watcher.press('2', 'fixed stand')
    watcher.until(lambda: watcher.place[2] > 0.31)
    watcher.pass_time(0.5)
    assert 0.31 < watcher.place[2] < 0.36
    assert_it_trots(watcher)
    assert_it_goes_on_after_each_stop(watcher, processes[1])
    # It has not let go once.
    states = ['passive', 'fixed stand', 'trotting']
    assert watcher.states == states
    assert_time_passes_when_it_is_gone(watcher, processes)


def assert_it_trots(watcher):
    """Trot ahead by the stick."""
    watcher.press('4', 'trotting')
    for _ in range(3):
        watcher.stick('w')
    start = watcher.place
    watcher.until(lambda: watcher.place[0] - start[0] > 0.1)
    assert abs(watcher.place[1] - start[1]) < 0.1


def assert_it_goes_on_after_each_stop(watcher, legs):
    """Stop the leg controller for longer and longer, while it trots."""
    for stop, looks in zip(STOPS, (5, 8), strict=True):  # a fall is seen at the end, too
        legs.send_signal(signal.SIGSTOP)
        # What was on its way is answered; then physics stands.
        watcher.pass_wall_time(0.5 * stop)
        held_at = watcher.now
        watcher.pass_wall_time(0.5 * stop)
        assert watcher.now <= held_at + 0.05
        legs.send_signal(signal.SIGCONT)
        lowest = watcher.place[2]
        for _ in range(looks):
            watcher.pass_time(0.1)
            lowest = min(lowest, watcher.place[2])
        assert watcher.states[-1] == 'trotting', stop
        assert lowest > 0.25, stop


def assert_time_passes_when_it_is_gone(watcher, processes):
    """End the leg controller."""
    simulator, legs = processes
    legs.terminate()
    legs.wait(PATIENCE)
    watcher._processes = [simulator]
    gone_at = watcher.now
    watcher.until(lambda: watcher.place[2] < 0.25)  # the motors brake, the robot sinks
    assert watcher.now < gone_at + 1.0
