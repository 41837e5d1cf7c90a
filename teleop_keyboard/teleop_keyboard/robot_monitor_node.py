# SPDX-License-Identifier: Apache-2.0
"""What the robot tells of itself, for the dashboard."""

from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String
from wasd_core.topics import LATCHED
from wasd_core.topics import LATEST

from teleop_keyboard.conversions import from_twist
from teleop_keyboard.ramp import Velocity

# Odometry older than this is none [s].
ODOMETRY_LIFETIME = 1.0


class RobotMonitorNode(Node):
    """Listens to `odom` and `state`; both may be silent."""

    def __init__(self) -> None:
        super().__init__('robot_monitor')
        self._velocity: Velocity | None = None
        self._heard_at = self.get_clock().now()
        self.state: str | None = None
        self._inputs = [
            self.create_subscription(Odometry, 'odom', self._on_odometry, LATEST),
            self.create_subscription(String, 'state', self._on_state, LATCHED),
        ]

    @property
    def velocity(self) -> Velocity | None:
        """The robot's velocity by its odometry, None when there is none of late."""
        age = 1e-9 * (self.get_clock().now() - self._heard_at).nanoseconds
        return self._velocity if age < ODOMETRY_LIFETIME else None

    def _on_odometry(self, message: Odometry) -> None:
        self._velocity = from_twist(message.twist.twist)
        self._heard_at = self.get_clock().now()

    def _on_state(self, message: String) -> None:
        self.state = message.data
