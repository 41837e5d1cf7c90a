# SPDX-License-Identifier: Apache-2.0
"""The leg controller walks a robot that it knows by topics only: in one process, and in two."""

from collections.abc import Iterator
import os
import subprocess
import sys
import time

from geometry_msgs.msg import Twist
from mujoco_sim.simulator_node import SimulatorNode
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from quadruped_sim.leg_controller_node import LegControllerNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from robot_description.packages import share_directory
from rosgraph_msgs.msg import Clock
import starting
from std_msgs.msg import String

pytestmark = pytest.mark.slow

LAIKAGO = str(
    share_directory('example-robot-data') / 'robots/laikago_description/urdf/laikago.urdf'
)
PERIOD = 0.002
# Slower than real time, so that two processes on a busy machine can keep in step.
SPEED = 0.5


class Driver(Node):
    """Presses keys, drives, and sees clock, state, odometry and truth."""

    def __init__(self):
        super().__init__('driver')
        self.now, self.states, self.odometry, self.truth = 0.0, [], [], []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'state', lambda m: self.states.append(m.data), latched)
        self.create_subscription(Odometry, 'odom', self.odometry.append, 1000)
        self.create_subscription(Odometry, 'ground_truth/odom', self.truth.append, 1000)
        self.create_subscription(Clock, '/clock', self._on_clock, 10)
        self.keys = self.create_publisher(String, 'keys', 100)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)

    def press(self, key):
        self.keys.publish(String(data=key))

    def drive(self, vx):
        message = Twist()
        message.linear.x = vx
        self.cmd_vel.publish(message)

    def _on_clock(self, message):
        self.now = message.clock.sec + 1e-9 * message.clock.nanosec


def place(odometry):
    """Return where an odometry message says the robot is [m]."""
    position = odometry.pose.pose.position
    return np.array((position.x, position.y, position.z))


class Rig:
    """A simulator and a leg controller that know each other by topics only."""

    def __init__(self, spawn, spin_until, description, **parameters):
        self.simulator = spawn(
            SimulatorNode(
                parameter_overrides=[
                    Parameter('description', value=description),
                    Parameter('state_rate', value=1.0 / PERIOD),
                ]
            )
        )
        self.simulator.schedule_publishing()
        self.world = self.simulator._world
        parameters['description'] = description
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.legs = spawn(LegControllerNode(parameter_overrides=overrides))
        self.peer = spawn(Driver())
        self._pump, self._spin_until = spawn.pump, spin_until
        for topic, count in (('joint_commands', 1), ('joint_states', 1), ('imu/data', 1)):
            spin_until(self._pump, lambda t=topic, n=count: self.peer.count_subscribers(t) >= n)
        for talk in (self.peer.keys, self.peer.cmd_vel):
            spin_until(self._pump, talk.get_subscription_count)
        # The first reading starts the controller's clock; it answers from the second on.
        spin_until(
            self._pump,
            lambda: self.world.time > 0.0 and self._answers(),
            step=lambda: self.simulator.simulation.advance(2),
        )

    def run(self, duration):
        """Simulate; every reading is answered before the next, whatever the host."""
        for _ in range(round(duration / PERIOD)):
            self.simulator.simulation.advance(2)
            self._spin_until(self._pump, self._answers)

    def press(self, key, state):
        self.peer.press(key)
        self._spin_until(self._pump, lambda: self.legs.controller._machine._due is not None)
        self.run(2 * PERIOD)
        assert self.legs.controller.state == state

    def drive(self, vx):
        self.peer.drive(vx)
        filtered = self.legs.controller.command_filter
        self._spin_until(self._pump, lambda: filtered._is_new)

    def _answers(self):
        return self.simulator._commanded_at == self.world.time


@pytest.mark.parametrize(
    ('description', 'estimator', 'height', 'frame'),
    [
        ('go2', 'kalman', 0.335, 'base'),
        ('go2', 'truth', 0.335, 'base'),
        (LAIKAGO, 'kalman', 0.42, 'trunk'),  # other order of joints, no link for the IMU
    ],
    ids=['go2', 'go2-truth', 'laikago'],
)
def test_keys_and_cmd_vel_walk_the_simulated_robot_over_topics(
    spawn, spin_until, description, estimator, height, frame
):
    rig = Rig(spawn, spin_until, description, estimator=estimator)
    rig.press('2', 'fixed stand')
    rig.run(2.2)
    assert rig.world.base().position[2] == pytest.approx(height, abs=0.025)
    rig.press('5', 'move base')
    for _ in range(8):
        rig.drive(0.4)
        rig.run(0.2)
    truth = rig.world.base()
    assert truth.planar_velocity[0] == pytest.approx(0.4, abs=0.08)
    assert truth.tilt < 0.1
    spin_until(spawn.pump, lambda: len(rig.peer.odometry) > 150)
    assert np.linalg.norm(place(rig.peer.odometry[-1]) - truth.position) < 0.05
    assert rig.peer.states == ['passive', 'fixed stand', 'move base']
    assert {message.child_frame_id for message in rig.peer.odometry} == {frame}


@pytest.fixture
def processes(isolated_ros) -> Iterator[list[subprocess.Popen]]:
    """Start simulator and leg controller, each in a process of its own; end them afterwards."""
    commands = (
        ('mujoco_sim.simulator_node', '-p', 'description:=go2', '-p', 'state_rate:=500.0')
        + ('-p', f'speed:={SPEED}'),
        ('quadruped_sim.leg_controller_node',),
    )
    started = [
        starting.Popen(
            [sys.executable, '-m', module, '--ros-args', *rest],
            env=os.environ.copy(),
            start_new_session=True,
        )
        for module, *rest in commands
    ]
    yield started
    for process in started:
        process.terminate()
    for process in started:
        process.wait(10.0)


class Watch:
    """Waits in simulated time, so that it does not matter how fast the machine is."""

    def __init__(self, driver, pump, processes):
        self._driver, self._pump, self._processes = driver, pump, processes

    def until(self, condition, patience=60.0):
        """Handle messages until a condition holds, at most `patience` [s] of wall time."""
        deadline = time.monotonic() + patience
        while not condition():
            assert all(process.poll() is None for process in self._processes)
            assert time.monotonic() < deadline, self._driver.states
            self._pump.handle(0.02)

    def pass_time(self, duration, each=lambda: None):
        """Let simulated time pass [s], doing something ten times a second of it."""
        end = self._driver.now + duration
        while self._driver.now < end:
            each()
            following = min(end, self._driver.now + 0.1)
            self.until(lambda following=following: self._driver.now >= following)


def test_two_processes_walk_over_topics(spawn, processes):
    driver = spawn(Driver())
    watch = Watch(driver, spawn.pump, processes)
    watch.until(lambda: driver.states == ['passive'] and driver.truth)
    watch.until(lambda: driver.keys.get_subscription_count())
    watch.until(lambda: driver.cmd_vel.get_subscription_count())
    driver.press('2')
    watch.until(lambda: driver.states[-1] == 'fixed stand')
    watch.pass_time(2.5)
    assert 0.31 < place(driver.truth[-1])[2] < 0.36
    driver.press('5')
    watch.until(lambda: driver.states[-1] == 'move base')
    start = place(driver.truth[-1])
    watch.pass_time(3.0, lambda: driver.drive(0.5))
    moved = place(driver.truth[-1]) - start
    assert moved[0] > 0.5
    assert abs(moved[1]) < 0.2
    assert place(driver.truth[-1])[2] > 0.25
    assert driver.states == ['passive', 'fixed stand', 'move base']  # it has not let go
    # Silence: it stands again.
    watch.pass_time(2.0)
    rest = place(driver.truth[-1])
    watch.pass_time(0.5)
    assert np.linalg.norm(place(driver.truth[-1]) - rest) < 0.02
