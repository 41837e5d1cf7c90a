# SPDX-License-Identifier: Apache-2.0
"""Time that passed without the controller: nothing catches up, and no command outlives it."""

import time

from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import DiffDriveParameters
from geometry_msgs.msg import Twist
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from wasd_core.timing import Absence, AFTERMATH

WHEELS = ['left_wheel_joint', 'right_wheel_joint']
RADIUS = 0.06
PERIODS = [0.005, 0.05, 0.2, 0.5, 1.0]
DRIVES = {
    'float': {},
    'arbotix': {'mode': 'arbotix'},
    'legacy': {'mode': 'arbotix', 'legacy': True, 'accel_limit': 100.0},
}


class Wheel:
    """A wheel that stands or follows what its motor is told at once."""

    def __init__(self, unit):
        self.unit, self.angle = unit, 0.0

    def run(self, count, dt, late=0.0, blocked=False):
        """Step so many times; return the greatest speed that the motor was told [m/s]."""
        fastest = 0.0
        for _ in range(count):
            speed = max(self.unit.step(self.angle, self.angle, dt, late), key=abs)
            self.angle += 0.0 if blocked else speed * min(dt, 0.1)
            fastest = max(fastest, abs(speed) * RADIUS)
        return fastest


@pytest.fixture(params=DRIVES)
def unit(request, mbot):
    return DiffDrive(mbot, DiffDriveParameters(cmd_vel_timeout=0.5, **DRIVES[request.param]))


@pytest.mark.parametrize('gap', [0.2, 1.0, 4.2, 60.0])
def test_wheels_that_stood_in_a_gap_do_not_catch_up(unit, gap):
    wheel = Wheel(unit)
    for _ in range(10):
        unit.controller.command(0.3, 0.0)
        wheel.run(20, 0.005)
    # The command is given again, so that it is not the time-out that stops the wheels.
    wheel.run(1, gap, blocked=True)
    unit.controller.command(0.3, 0.0)
    assert wheel.run(80, 0.005) <= 0.3 * 1.05


@pytest.mark.parametrize('gap', [0.6, 4.2])
def test_a_stop_that_was_due_in_a_gap_is_over_after_it(mbot, gap):
    unit = DiffDrive(mbot, DiffDriveParameters(cmd_vel_timeout=0.1))
    unit.controller.command(0.3, 0.0)
    Wheel(unit).run(10, 0.005)
    unit.step(0.0, 0.0, gap)
    assert unit.controller.velocity == (0.0, 0.0)
    assert unit.controller.state == 'stopped'


@pytest.mark.parametrize('period', PERIODS)
def test_a_command_times_out_by_the_time_that_has_passed_in_fake_mode(mbot, period):
    unit = DiffDrive(mbot, DiffDriveParameters(mode='fake', cmd_vel_timeout=0.5))
    unit.step_fake(period)
    unit.controller.command(0.3, 0.0)
    passed = 0.0
    unit.step_fake(period)
    while unit.controller.target.linear:
        unit.step_fake(period)
        passed += period
    assert passed <= 0.5 + period + 1e-9


class Peer(Node):
    """Publishes joint states and velocity commands, and hears what the motors are told."""

    def __init__(self):
        super().__init__('peer')
        self.told = []
        self.create_subscription(JointTrajectory, 'joint_commands', self._on_command, 1000)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)
        self.states = self.create_publisher(JointState, 'joint_states', 10)

    def drive(self, speed):
        message = Twist()
        message.linear.x = speed
        self.cmd_vel.publish(message)

    def state(self, time):
        message = JointState(name=WHEELS, position=[0.0, 0.0])
        message.header.stamp.sec = int(time)
        message.header.stamp.nanosec = round(1e9 * (time - int(time)))
        self.states.publish(message)

    def _on_command(self, message):
        self.told.append(message.points[0].velocities[0])


@pytest.fixture
def connect(spawn, spin_until):
    """Return a function that makes a controller with parameters, and a peer that it hears."""

    def connect(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        driver = spawn(DiffDriveControllerNode(parameter_overrides=overrides))
        peer = spawn(Peer())
        for publisher in (peer.cmd_vel, peer.states):
            spin_until(spawn.pump, publisher.get_subscription_count)
        spin_until(spawn.pump, lambda: driver.count_subscribers('joint_commands'))
        return driver, peer

    return connect


@pytest.mark.slow
@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('period', PERIODS)
def test_cmd_vel_times_out_at_any_rate_of_joint_states(connect, spawn, spin_until, period, drive):
    driver, peer = connect(cmd_vel_timeout=0.5, **DRIVES[drive])
    now = 1.0

    def answer():
        count = len(peer.told)
        peer.state(now)
        spin_until(spawn.pump, lambda: len(peer.told) > count)
        return driver.controller.target.linear

    answer()
    for _ in range(5):
        now += period
        # The command comes at the end of the period, as far as wall time can tell.
        driver._stepped_wall -= 1000.0
        twist = Twist()
        twist.linear.x = 0.3
        driver.cmd_vel.hear(twist)
        last = now
        assert answer() == pytest.approx(0.3)
    while answer():
        now += period
    # arbotix's driver looks at the age of a command ten times a second.
    period = max(period, 0.1) if drive == 'legacy' else period
    assert 0.5 - period <= now - last <= 0.5 + period + 1e-9


@pytest.mark.slow
def test_what_was_sent_while_the_controller_stood_still_moves_nothing(connect, spawn, spin_until):
    driver, peer = connect(cmd_vel_timeout=0.5)
    peer.drive(0.3)
    spin_until(spawn.pump, lambda: driver.controller.target.linear)
    peer.drive(0.25)
    peer.drive(0.2)
    time.sleep(0.1)
    # Messages wait; now the process is as if it had been stopped all the while.
    driver._absence._absence._lived_at -= 4.2
    for stamp in (1.0, 1.02, 1.04, 5.24):
        peer.state(stamp)
    spin_until(spawn.pump, lambda: len(peer.told) == 4)
    assert peer.told == [0.0] * 4
    peer.drive(0.1)
    spin_until(spawn.pump, lambda: driver.controller.target.linear == 0.1)


@pytest.mark.slow
@pytest.mark.parametrize(('ago', 'speed'), [(5.0, 0.0), (3.0, 0.0), (0.1, 0.3)])
def test_of_a_pause_of_the_simulator_a_velocity_counts_only_if_it_is_new(spawn, ago, speed):
    driver = spawn(DiffDriveControllerNode())
    state, twist = JointState(name=WHEELS, position=[0.0, 0.0]), Twist()
    state.header.stamp.sec, twist.linear.x = 1, 0.3
    driver._on_joint_states(state)
    driver.cmd_vel.hear(twist)
    # The simulator is as if it had been paused.
    driver.cmd_vel._steps._lived_at -= 4.2
    driver.cmd_vel.came_at -= ago
    state.header.stamp.nanosec = 20_000_000
    driver._on_joint_states(state)
    assert driver.controller.target.linear == speed


def test_absence_judges_by_the_clock_of_the_sender():
    for ahead in (0.0, 5.0, -5.0):
        absence = Absence()
        absence.beat(0.0)
        for sent in (0.1, 0.2):
            assert absence.beat(sent) == 0.0
            assert not absence.is_stale(sent + ahead, sent + 0.001)
        assert absence.beat(4.2) == pytest.approx(4.0)
        assert absence.is_stale(0.3 + ahead, 4.2)
        assert absence.is_stale(4.1 + ahead, 4.3)  # sent again by the middleware
        assert not absence.is_stale(4.25 + ahead, 4.3)
        for tenths in range(1, round(10 * AFTERMATH)):
            assert absence.beat(4.3 + 0.1 * tenths) == 0.0
        assert not absence.is_stale(4.3 + ahead, 4.3 + AFTERMATH)
