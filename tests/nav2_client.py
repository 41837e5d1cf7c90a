# SPDX-License-Identifier: Apache-2.0
"""A client of Nav2's actions, and the navigator in the same process."""

from navigation_stand_ins import odometry, scan, StandInLocator, StandInPilot
import numpy as np
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import QoSProfile
from wasd_navigation.messages import to_pose_stamped
from wasd_navigation.navigator_node import NavigatorNode
from wasd_navigation.robot_navigator import RobotNavigator


class Client:
    """A client of one action of a navigator with stand-ins."""

    def __init__(self, spawn, spin_until, action, name):
        parts = StandInLocator(), StandInPilot()
        self.navigation = RobotNavigator(parts=parts)
        self.navigator = spawn(NavigatorNode(self.navigation))
        self.sent, self.feedback = [], []
        self.navigation.send = lambda velocity: self.sent.append(velocity.tolist())
        self.logic = self.navigator.navigator
        self.logic.pilot.end = ('driving', '')
        self.logic.move(odometry())
        self.logic.see(scan(), odometry())
        self._action = action
        self._pump, self._spin_until = spawn.pump, spin_until
        self._client = ActionClient(
            spawn(Node('client')),
            action,
            name,
            cancel_service_qos_profile=QoSProfile(depth=200),
        )
        self.wait(self._client.server_is_ready)

    def wait(self, condition, step=None):
        self._spin_until(self._pump, condition, step=step)

    def pose(self, x, frame='map'):
        """Return a place straight on."""
        return to_pose_stamped(np.array([x, 0.0, 0.0]), self._stamp, frame)

    def send(self, **fields):
        """Return the handle of a goal that was accepted."""
        goal = self._action.Goal(**fields)
        future = self._client.send_goal_async(goal, lambda sent: self.feedback.append(sent))
        self.wait(future.done)
        assert future.result().accepted
        return future.result()

    def result(self, handle):
        """Return status and result of a goal."""
        future = handle.get_result_async()
        self.wait(future.done)
        return future.result().status, future.result().result

    def close(self):
        self._client.destroy()

    @property
    def _stamp(self):
        return self.navigator.get_clock().now().to_msg()
