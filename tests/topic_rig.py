# SPDX-License-Identifier: Apache-2.0
"""A simulator and a controller in one process, step by step, by topics only."""

from geometry_msgs.msg import Twist
from mujoco_sim.simulator_node import SimulatorNode
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

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
    """A simulator and a controller of its robot, which know each other by topics only."""

    def __init__(
        self,
        spawn,
        spin_until,
        make_controller,
        description,
        simulator=(),
        period=PERIOD,
        **parameters,
    ):
        """
        `simulator` are parameters of the simulator, by name; `parameters` the controller's.

        `period` is that of readings [s].
        """
        self.period = period
        self.simulator = spawn(
            SimulatorNode(
                parameter_overrides=[
                    Parameter('description', value=description),
                    Parameter('state_rate', value=1.0 / period),
                    *(Parameter(name, value=value) for name, value in dict(simulator).items()),
                ]
            )
        )
        self.simulator.schedule_publishing()
        self.world = self.simulator._world
        parameters['description'] = description
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.node = spawn(make_controller(parameter_overrides=overrides))
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
            step=self._advance,
        )

    def run(self, duration):
        """Simulate; every reading is answered before the next, whatever the host."""
        for _ in range(round(duration / self.period)):
            self._advance()
            self._spin_until(self._pump, self._answers)

    def wait_until(self, condition):
        """Handle messages until the condition holds; no time passes."""
        self._spin_until(self._pump, condition)

    def _advance(self):
        self.simulator.simulation.advance(round(1000 * self.period))

    def _answers(self):
        return self.simulator._commanded_at == self.world.time
