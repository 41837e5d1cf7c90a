# SPDX-License-Identifier: Apache-2.0
"""Publishes the truth: the robot's pose, the error of its odometry, its slip."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from robot_description.robot import Robot
from sensor_msgs.msg import JointState
from wasd_core.messages import from_odometry, to_joint_state, to_odometry, to_seconds, to_stamp
from wasd_core.robot_io import BaseOdometry, BaseState
from wasd_core.rotations import rotate_inverse
from wasd_core.topics import has_listener, has_subscriber, RELIABLE, SENSOR_DATA

from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.sensors.wheel_slip import WheelSlip
from mujoco_sim.world import World

# The frame of what the simulator knows: fixed, without drift, and in no tree of /tf but that of
# robots which share a world. `odom` begins where the robot does, and drifts away.
WORLD_FRAME = 'world'
# Odometry may arrive so many instants after the one that it is about.
REMEMBERED = 2000


class TruthPublisher:
    """
    Publishes `ground_truth/odom` and `wheel_slip`, and answers each `odom` with its `odom_error`.

    Odometry of its own process is handed to `compare`. Over topics, the truth of an instant is
    kept until the odometry of that instant arrives, so the error is as exact, however late it is;
    `odom` is subscribed to only while somebody has subscribed to `odom_error`.
    """

    def __init__(self, node: Node, world: World, robot: Robot) -> None:
        self._node = node
        self._world = world
        self._odom, self._root = f'{world.prefix}odom', world.prefix + robot.root
        self._truth = node.create_publisher(Odometry, 'ground_truth/odom', RELIABLE)
        self._error = node.create_publisher(Odometry, 'odom_error', RELIABLE)
        self._odometry: Any = None
        self._past: OrderedDict[tuple[int, int], BaseState] = OrderedDict()
        self._slip = WheelSlip(world, robot, Snapshot(world))
        if self._slip.joints:
            self._slips = node.create_publisher(JointState, 'wheel_slip', RELIABLE)

    def publish(self, tell: Callable[[Any, Any], None]) -> None:
        """Give the truth of now to `tell`: publisher and message."""
        stamp = to_stamp(self._world.time)
        if has_listener(self._truth):
            base = self._world.base()
            tell(self._truth, to_ground_truth(base, WORLD_FRAME, self._root, stamp))
        if self._slip.joints and has_listener(self._slips):
            ratios, speeds = zip(*self._slip.measure(), strict=True)
            tell(self._slips, to_joint_state(self._slip.joints, stamp, ratios, speeds))

    def compare(self, odometry: Callable[[], Odometry | None]) -> None:
        """Publish the error of the odometry of now, which is asked for only if needed."""
        estimate = odometry() if has_listener(self._error) else None
        if estimate is not None:
            truth = self._to_truth(self._world.base_since_start(), estimate.header.stamp)
            self._error.publish(to_odometry_error(truth, estimate))

    def remember(self) -> None:
        """Keep the truth of now for odometry that is under way; to be called in each instant."""
        # A recording does not count: odometry arrives when the host likes.
        if not has_subscriber(self._node, self._error):
            if self._odometry is not None:
                self._node.destroy_subscription(self._odometry)
                self._odometry = None
                self._past.clear()
            return
        if self._odometry is None:
            self._odometry = self._node.create_subscription(
                Odometry, 'odom', self._on_odometry, SENSOR_DATA
            )
        self._past[_key(to_stamp(self._world.time))] = self._world.base_since_start()
        if len(self._past) > REMEMBERED:
            self._past.popitem(last=False)

    def _on_odometry(self, odometry: Odometry) -> None:
        stamp = odometry.header.stamp
        base = self._past.get(_key(stamp))
        if base is None:
            self._node.get_logger().warning(
                f'odom of {to_seconds(stamp):.3f} s has no stamp of this '
                f'simulation (it is at {self._world.time:.3f} s): no odom_error',
                throttle_duration_sec=10.0,
            )
            return
        truth = self._to_truth(base, stamp)
        self._error.publish(to_odometry_error(truth, odometry))

    def _to_truth(self, base: BaseState, stamp: Time) -> Odometry:
        return to_ground_truth(base, self._odom, self._root, stamp)


def _key(stamp: Time) -> tuple[int, int]:
    return stamp.sec, stamp.nanosec


def to_ground_truth(base: BaseState, frame: str, child_frame: str, stamp: Time) -> Odometry:
    """Return the true pose in `frame`, that of odometry, and the twist in the base frame."""
    velocity = rotate_inverse(base.orientation, base.linear_velocity)
    exact = np.zeros((6, 6))
    truth = BaseOdometry(
        base.position, base.orientation, velocity, base.angular_velocity, exact, exact
    )
    return to_odometry(truth, frame, child_frame, stamp)


def to_odometry_error(truth: Odometry, odometry: Odometry) -> Odometry:
    """
    Return truth - odometry of one instant, in the odom frame.

    The position is the difference of the two, the orientation the turn from odometry's to the
    true one, the twist the difference of the two, in the base frame.
    """
    true, said, exact = from_odometry(truth), from_odometry(odometry), np.zeros((6, 6))
    w, x, y, z = true.orientation
    a, b, c, d = said.orientation
    turn = (  # true times the conjugate of said
        w * a + x * b + y * c + z * d,
        x * a - w * b - y * d + z * c,
        y * a - w * c - z * b + x * d,
        z * a - w * d - x * c + y * b,
    )
    linear = true.linear_velocity - said.linear_velocity
    angular = true.angular_velocity - said.angular_velocity
    position = true.position - said.position
    error = BaseOdometry(position, np.array(turn), linear, angular, exact, exact)
    header = odometry.header
    return to_odometry(error, header.frame_id, odometry.child_frame_id, header.stamp)
