# SPDX-License-Identifier: Apache-2.0
"""The guard on ROS: velocity, scan and odom in; the limited velocity out."""

import sys
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from wasd_core.messages import from_odometry, to_seconds
from wasd_core.ros_parameters import declare_parameters
from wasd_core.streams import visible
from wasd_core.timing import Watchdog
from wasd_core.topics import AbsenceWatch, LATCHED, RELIABLE, SENSOR_DATA
from wasd_core.velocity_messages import stamped, to_twist, to_velocity

from wasd_navigation.guard import Guard, GuardSenses, warm_up
from wasd_navigation.guard_parameters import guard, GuardNodeParameters
from wasd_navigation.messages import hear_fixed_frames, take_scan

# A command is looked at again so often [s] while it is in force: no longer than this without
# another one [s], as controllers forget it then.
PERIOD, IN_FORCE = 0.05, 0.5


class GuardNode(Node):
    """
    Relays velocities from `cmd_vel_in_topic` to `cmd_vel_out_topic`, limited to keep clear.

    Takes `scan`, `odom` and the lidar's place from /tf_static. `~/state` says what it does to the
    command in force, and why; '' while it does nothing.

    Raises:
        UserError: a parameter is not valid.
    """

    def __init__(self, *, parameter_overrides: list[Parameter] | None = None) -> None:
        super().__init__('guard', parameter_overrides=parameter_overrides or [])
        settings = declare_parameters(
            self, GuardNodeParameters, lambda changed: self.guard.tune(changed)
        )
        braking = settings.braking
        rates = np.array((braking.forward, braking.lateral, braking.yaw))
        warm_up(settings.footprint)
        self.guard = Guard(settings.footprint, rates, settings)
        self.senses = GuardSenses(self.guard)
        self.senses.warn = self._warn
        self._asked, self._heard = np.zeros(3), Watchdog(IN_FORCE)
        self._stepped_at: float | None = None
        self._base_frame = ''
        self._is_stamped = settings.enable_stamped_cmd_vel
        kind = TwistStamped if self._is_stamped else Twist
        self._out = self.create_publisher(kind, settings.cmd_vel_out_topic, RELIABLE)
        self._state = self.create_publisher(String, '~/state', LATCHED)
        self._said = ''
        self._absence = AbsenceWatch(self, self._on_return)
        # rclpy's types know no callback of two parameters.
        on_velocity: Any = self._on_velocity
        self.create_subscription(kind, settings.cmd_vel_in_topic, on_velocity, RELIABLE)
        self.create_subscription(OdometryMessage, 'odom', self._on_odometry, SENSOR_DATA)
        self.create_subscription(LaserScan, settings.scan_topic, self._on_scan, SENSOR_DATA)
        hear_fixed_frames(self, self.senses)
        self.create_timer(PERIOD, self.step)

    def step(self) -> None:
        """Look again at the command in force: something may have come nearer."""
        self._absence.beat()
        self._pass_time()
        if self._heard.is_alive:
            before = self.guard.last.velocity
            velocity = self._limit()
            if not np.array_equal(velocity, before):
                self._publish(velocity)

    def close(self) -> None:
        """Leave the robot stopped."""
        if self._heard.is_alive:
            self._publish(np.zeros(3))

    def _pass_time(self) -> None:
        now = 1e-9 * self.get_clock().now().nanoseconds
        dt = 0.0 if self._stepped_at is None else now - self._stepped_at
        self._stepped_at = now
        if dt < 0.0:  # time has jumped back: all that is known is old
            self.senses.reset()
        self._heard.step(dt)
        self.guard.pass_time(dt)

    def _limit(self) -> np.ndarray:
        guarded = self.guard.step(self._asked)
        words = ': '.join(filter(None, (guarded.action, guarded.why)))
        if words != self._said:
            self._said = words
            self._state.publish(String(data=words))
        return guarded.velocity

    def _on_return(self, gap: float) -> None:
        """Begin without a command after this process stood still: nobody knows who wants it."""
        self.close()
        self._heard.reset()

    def _on_velocity(self, message: Any, info: dict[str, int]) -> None:
        if self._absence.is_stale(info['source_timestamp']):
            return  # it waited meanwhile
        self._asked = np.array(to_velocity(message))
        if self._is_stamped:
            self._base_frame = message.header.frame_id
        self._pass_time()
        velocity = self._limit()
        self._heard.hear()
        self._publish(velocity)

    def _publish(self, velocity: np.ndarray) -> None:
        stamp = self.get_clock().now().to_msg() if self._is_stamped else None
        vx, vy, wz = velocity.tolist()
        self._out.publish(stamped(to_twist(vx, vy, 0.0, wz), stamp, self._base_frame))

    def _on_odometry(self, message: OdometryMessage) -> None:
        self._pass_time()
        now = to_seconds(message.header.stamp)
        frames = message.header.frame_id, message.child_frame_id
        self.senses.take_odometry(now, from_odometry(message), frames)

    def _on_scan(self, message: LaserScan) -> None:
        self._pass_time()
        take_scan(message, self.senses)

    def _warn(self, words: str) -> None:
        self.get_logger().warning(visible(words), throttle_duration_sec=5.0)


if __name__ == '__main__':
    sys.exit(guard())
