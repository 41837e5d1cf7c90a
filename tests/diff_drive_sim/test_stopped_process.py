# SPDX-License-Identifier: Apache-2.0
"""The controller as a process that is stopped while it drives, and goes on."""

from collections.abc import Iterator
import os
import signal
import subprocess
import sys
import time

from geometry_msgs.msg import Twist
from mujoco_sim.simulator_node import SimulatorNode
import programs
import pytest
from rclpy.node import Node
from terminals import PATIENCE
from trajectory_msgs.msg import JointTrajectory

pytestmark = pytest.mark.slow

RADIUS, SPEED, STANDSTILL, TIMEOUT = 0.06, 0.3, 0.005, 0.5


@pytest.fixture
def controller(isolated_ros) -> Iterator[subprocess.Popen]:
    """Start the controller of mbot's wheels; end it afterwards."""
    words = [sys.executable, '-m', 'diff_drive_sim.diff_drive_controller_node']
    process = programs.start(words, env=os.environ.copy(), start_new_session=True)
    yield process
    process.send_signal(signal.SIGCONT)
    process.terminate()
    process.wait(PATIENCE)


class Drive:
    """A simulator in real time that waits for nobody, a sender of cmd_vel, and a witness."""

    def __init__(self, spawn, spin_until):
        self._node = spawn(SimulatorNode())
        self._node.schedule_publishing()
        self._peer = spawn(Node('peer'))
        self._cmd_vel = self._peer.create_publisher(Twist, 'cmd_vel', 10)
        self._pump = spawn.pump
        self.simulation = self._node.simulation
        self.world = self._node._world
        self.speeds = []
        self.answers = []  # when the controller was heard [s]
        self._peer.create_subscription(
            JointTrajectory, 'joint_commands', lambda _: self.answers.append(self.world.time), 10
        )
        self.simulation.schedule.every(0.005, self._look)
        self._next_command = 0.0
        self.is_sending = False
        for topic in ('cmd_vel', 'joint_states'):
            spin_until(self._pump, lambda name=topic: self._peer.count_subscribers(name), 60.0)
        spin_until(self._pump, lambda: self._peer.count_publishers('joint_commands'))

    def run(self, duration):
        """Simulate in real time, whether the controller answers or not; return the speeds seen."""
        self.speeds = []
        end = self.world.time + duration
        self.simulation.pacer.restart()
        self.simulation.run(stop=lambda: self.world.time >= end, poll=self._poll)
        return self.speeds

    def run_on(self, duration):
        """Simulate until so long after the controller is heard; return when it was, and speeds."""
        self.answers.clear()
        speeds = []
        while not self.answers:  # a busy machine lets it wait
            assert len(speeds) < PATIENCE / 0.005, 'it does not go on'
            speeds += self.run(0.05)
        begin = self.answers[0]
        return begin, speeds + self.run(duration)

    def reach(self, speed):
        """Simulate until the wheels have a speed [m/s]; a busy machine needs more than once."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if self.run(1.0)[-1][1] == pytest.approx(speed, rel=0.1):
                return
        pytest.fail(f'{self.speeds[-1][1]} m/s, wanted {speed}')

    def _poll(self, timeout):
        self._pump.handle(timeout)
        if self.is_sending and time.monotonic() >= self._next_command:
            self._next_command = time.monotonic() + 0.05
            message = Twist()
            message.linear.x = SPEED
            self._cmd_vel.publish(message)

    def _look(self):
        wheels = self.world.joints().velocity[: len(self.world.motor_names)]
        self.speeds.append((self.world.time, float(abs(wheels).max()) * RADIUS))


# How long it is stopped, and how long commands go on meanwhile [s]: longer than a command counts,
# and longer than anything here has patience with it.
STOPS = ((1.0, 0.0), (6.0, 0.5))


def test_a_drive_that_was_stopped_stands_when_it_goes_on(spawn, spin_until, controller):
    drive = Drive(spawn, spin_until)
    for stopped, still_sent in STOPS:
        drive.is_sending = True
        drive.reach(SPEED)
        controller.send_signal(signal.SIGSTOP)
        if still_sent:
            drive.run(still_sent)  # nobody takes these
        drive.is_sending = False
        drive.run(stopped - still_sent)
        controller.send_signal(signal.SIGCONT)
        begin, speeds = drive.run_on(TIMEOUT)
        while speeds[-1][1] >= STANDSTILL:  # on a busy machine the wheels are told late
            assert drive.world.time < begin + 10.0 * TIMEOUT
            speeds += drive.run(0.1)
        assert max(speed for _, speed in speeds) <= 1.05 * SPEED
        assert max(speed for _, speed in drive.run(1.0)) < STANDSTILL
    # It was not stopped for good.
    drive.is_sending = True
    drive.reach(SPEED)
