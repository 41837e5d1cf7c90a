# SPDX-License-Identifier: Apache-2.0
"""The diff-drive controller on ROS: cmd_vel in, odom and joint commands out."""

import sys
from typing import Any

from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from mujoco_sim.conversions import to_joint_commands
from mujoco_sim.loading import load_robot
from mujoco_sim.world import JointCommand
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from robot_description.inlet import Inlet
from robot_description.node_support import declare_parameters
from robot_description.node_support import has_listener
from robot_description.node_support import run_node
from robot_description.tf import TfBroadcaster
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from diff_drive_sim.controller import DiffDriveController
from diff_drive_sim.conversions import to_odometry
from diff_drive_sim.conversions import to_transform
from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.geometry import find_wheels
from diff_drive_sim.parameters import DiffDriveParameters


class DiffDriveControllerNode(Node):
    """
    Drives two wheels from cmd_vel.

    Alone, it steps at each `joint_states` message and publishes `joint_commands`. In lock-step
    the simulation loop calls `control` and `publish_odometry`, and `cmd_vel.put` hands commands
    of the same process over.
    """

    def __init__(
        self, geometry: DiffDriveGeometry | None = None, *, lock_step: bool = False
    ) -> None:
        """
        Take the wheels' geometry, or find it in the robot that the parameter `description` names.

        Raises:
            InvalidParameter, DescriptionError, DiffDriveError: what is wrong, in one line.
        """
        super().__init__('diff_drive_controller')
        self.settings = declare_parameters(self, DiffDriveParameters, self._on_change)
        if geometry is None:
            geometry = find_wheels(load_robot(self.settings.description).robot)
        self.controller = DiffDriveController(geometry, self.settings)
        self.cmd_vel: Inlet[Any]
        if self.settings.stamped:
            self.cmd_vel = Inlet(self, TwistStamped, 'cmd_vel', self._on_twist_stamped)
        else:
            self.cmd_vel = Inlet(self, Twist, 'cmd_vel', self._on_twist)
        self._odometry = self.create_publisher(Odometry, 'odom', 10)
        self._tf = TfBroadcaster(self)
        if not lock_step:
            # Reliable: whoever listens is served, also who asks for no more than best effort.
            self._joint_commands = self.create_publisher(JointTrajectory, 'joint_commands', 10)
            self._last_state: Any = None
            self._published_at: Any = None
            self.create_subscription(
                JointState, 'joint_states', self._on_joint_states, qos_profile_sensor_data
            )

    def control(self, left: float, right: float, dt: float) -> JointCommand:
        """Return the command of the two motors, left then right, for wheel angles [rad]."""
        speeds = np.array(self.controller.step(left, right, dt))
        none = np.zeros(2)
        return JointCommand(none, speeds, none, none, np.full(2, self.settings.wheel_damping))

    def publish_odometry(self) -> None:
        """Publish odom and /tf with one stamp, the node's time."""
        self._publish_odometry(self.get_clock().now().to_msg())

    def close(self) -> None:
        """Leave the wheels stopped (the simulator's own watchdog brakes them, too)."""
        self.controller.reset()

    def _on_twist(self, message: Twist) -> None:
        if not self.controller.command(message.linear.x, message.angular.z):
            self.get_logger().warning(
                f'cmd_vel is not finite (linear.x {message.linear.x}, angular.z '
                f'{message.angular.z}): ignored',
                once=True,
            )

    def _on_twist_stamped(self, message: TwistStamped) -> None:
        self._on_twist(message.twist)

    def _on_joint_states(self, message: JointState) -> None:
        geometry = self.controller.geometry
        try:
            wheels = [
                message.position[message.name.index(name)]
                for name in (geometry.left_joint, geometry.right_joint)
            ]
        except (ValueError, IndexError):
            self.get_logger().warning(
                f'joint_states lacks {geometry.left_joint} or {geometry.right_joint}: ignored',
                once=True,
            )
            return
        stamp = message.header.stamp
        now = stamp.sec + 1e-9 * stamp.nanosec
        previous, self._last_state = self._last_state, now
        dt = 0.0 if previous is None else max(now - previous, 0.0)
        restarts = self.controller.odometry.restarts
        command = self.control(wheels[0], wheels[1], dt)
        if self.controller.odometry.restarts > restarts:
            self.get_logger().warning(
                'the wheel angles have jumped (was the robot reset?): odometry goes on from '
                'where it was',
                throttle_duration_sec=5.0,
            )
        names = (geometry.left_joint, geometry.right_joint)
        self._joint_commands.publish(to_joint_commands(names, command, stamp))
        due = 1.0 / self.settings.publish_rate
        if self._published_at is None or not 0.0 <= now - self._published_at < due - 1e-6:
            self._published_at = now
            self._publish_odometry(stamp)

    def _publish_odometry(self, stamp: Any) -> None:
        state = self.controller.odometry_state
        if has_listener(self._odometry):
            self._odometry.publish(to_odometry(state, stamp, self.settings))
        if self._tf.available:
            self._tf.send([to_transform(state, stamp, self.settings)])

    def _on_change(self, changed: DiffDriveParameters) -> None:
        self.settings = changed
        self.controller.parameters = changed


def main(args: list[str] | None = None) -> int:
    """Run the controller as a process of its own."""
    return run_node(DiffDriveControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
