# SPDX-License-Identifier: Apache-2.0
"""The leg controller walks a robot that it knows by topics only."""

from geometry_msgs.msg import Twist
from mujoco_sim.simulator_node import SimulatorNode
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from quadruped_sim.leg_controller_node import LegControllerNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_description.packages import share_directory
from std_msgs.msg import String

pytestmark = pytest.mark.slow

LAIKAGO = str(
    share_directory('example-robot-data') / 'robots/laikago_description/urdf/laikago.urdf'
)
PERIOD = 0.002


class Driver(Node):
    """Presses keys, drives, and sees state and odometry."""

    def __init__(self):
        super().__init__('driver', start_parameter_services=False)
        self.states, self.odometry = [], []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'state', lambda m: self.states.append(m.data), latched)
        self.create_subscription(Odometry, 'odom', self.odometry.append, 1000)
        self.keys = self.create_publisher(String, 'keys', 100)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)

    def press(self, key):
        self.keys.publish(String(data=key))

    def drive(self, vx):
        message = Twist()
        message.linear.x = vx
        self.cmd_vel.publish(message)


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
