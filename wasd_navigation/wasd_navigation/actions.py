# SPDX-License-Identifier: Apache-2.0
"""The actions navigate_to_pose and follow_waypoints, as Nav2's clients know them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
import importlib
from typing import Any

from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import GoalEvent
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from wasd_core.errors import InvalidMessage
from wasd_core.timing import Beat

from wasd_navigation.messages import to_pose_stamped
from wasd_navigation.navigator import Outcome, REPLACED
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.waypoints import Waypoints

# So many requests wait until they are handled: of a hundred at once by default ten are answered.
REQUESTS = qos_profile_parameters
FEEDBACK_RATE = 10.0
# What error_code says of a goal that was not reached; 0 is none, as in Nav2.
NOT_REACHED = 1


def action_type(kind: str) -> Any:
    """Return an action of nav2_msgs, or None where nav2_msgs is not installed, or lacks it."""
    try:
        return getattr(importlib.import_module('nav2_msgs.action'), kind, None)
    except ImportError:
        return None


class Action(ABC):
    """
    Serves an action of a node; each goal that comes takes the place of the one before.

    `in_map` turns a pose of a message into one of the map. A goal that something else has ended
    is aborted, with the reason in `error_msg`.
    """

    name: str
    kind: str

    def __init__(
        self,
        node: Node,
        navigation: RobotNavigator,
        in_map: Callable[[PoseStamped], np.ndarray],
    ) -> None:
        """Offer it where its type is installed."""
        self._navigation, self._in_map = navigation, in_map
        self._node = node
        self._handle: Any = None
        self._beat = Beat()
        self._type = action_type(self.kind)
        self._server: Any = None
        if self._type is not None:
            # What is done with a goal is done by steps, and told here when it has ended.
            self._server = ActionServer(
                node,
                self._type,
                self.name,
                execute_callback=lambda handle: self._type.Result(),
                handle_accepted_callback=self._on_goal,
                cancel_callback=self._on_cancel,
                goal_service_qos_profile=REQUESTS,
                result_service_qos_profile=REQUESTS,
                cancel_service_qos_profile=REQUESTS,
            )

    def step(self, now: float, frame: str) -> None:
        """Tell how far it is, at a time [s]; poses are in a frame."""
        if self._beat.is_due(now, FEEDBACK_RATE) and self._handle is not None:
            feedback = self._feedback(frame)
            if feedback is not None:
                self._handle.publish_feedback(feedback)

    def close(self) -> None:
        """Serve no more."""
        if self._server is not None:
            self._server.destroy()

    @abstractmethod
    def _feedback(self, frame: str) -> Any:
        """Return the feedback, None before there is any."""

    @abstractmethod
    def _begin(self, request: Any) -> None:
        """Do what a request asks for; refuse what cannot be driven to."""

    @abstractmethod
    def _fill(self, result: Any, outcome: Outcome) -> None:
        """Write into a result how the goal has ended."""

    def _on_goal(self, handle: Any) -> None:
        # No standstill is commanded between two goals, unless the new one is refused.
        # The goal before is told its end while its handle is still here.
        was_driving = self._navigation.give_up(REPLACED)
        self._handle = handle
        handle._update_state(GoalEvent.EXECUTE)  # `execute` would run to the end at once
        try:
            self._begin(handle.request)
        except InvalidMessage as error:
            self._navigation.refuse(str(error))
            self._end(Outcome('refused', str(error)))
        if was_driving and self._navigation.navigator.goal is None:
            self._navigation.stand()

    def _on_cancel(self, handle: Any) -> CancelResponse:
        if handle is self._handle:
            self._navigation.stop('asked to')
        return CancelResponse.ACCEPT

    def _end(self, outcome: Outcome) -> None:
        """Tell the result after this handler: a cancel is noted after it."""
        handle, self._handle = self._handle, None
        if handle is not None:
            result = self._type.Result()
            self._fill(result, outcome)
            self._server.notify_execute(
                handle, lambda handle: self._finish(handle, result, outcome)
            )

    def _finish(self, handle: Any, result: Any, outcome: Outcome) -> Any:
        if outcome.state == 'arrived':
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
            result.error_code, result.error_msg = 0, ''
        else:
            handle.abort()
        return result


class NavigateToPose(Action):
    """Drives to a pose."""

    name, kind = 'navigate_to_pose', 'NavigateToPose'

    def __init__(
        self,
        node: Node,
        navigation: RobotNavigator,
        in_map: Callable[[PoseStamped], np.ndarray],
    ) -> None:
        """Offer it where its type is installed."""
        super().__init__(node, navigation, in_map)
        navigation.navigator.on_end.append(self._end)

    def _begin(self, request: Any) -> None:
        self._navigation.go(self._in_map(request.pose))

    def _feedback(self, frame: str) -> Any:
        navigator = self._navigation.navigator
        pose, pilot = navigator.pose, navigator.pilot
        # Before the way is drawn nobody knows how long it is.
        if pose is None or not len(pilot.path):
            return None
        stamp = self._node.get_clock().now().to_msg()
        return self._type.Feedback(
            current_pose=to_pose_stamped(pose, stamp, frame),
            navigation_time=Duration(seconds=navigator.elapsed).to_msg(),
            estimated_time_remaining=Duration(seconds=pilot.time_left).to_msg(),
            number_of_recoveries=pilot.recoveries,
            distance_remaining=float(pilot.distance_left),
        )

    def _fill(self, result: Any, outcome: Outcome) -> None:
        if outcome.state != 'arrived':
            result.error_code = NOT_REACHED
            result.error_msg = ': '.join(filter(None, outcome))


class FollowWaypoints(Action):
    """Drives to poses one after another; one that cannot be reached is skipped, and told."""

    name, kind = 'follow_waypoints', 'FollowWaypoints'
    _waypoints: Waypoints | None = None

    def _begin(self, request: Any) -> None:
        poses, first = request.poses, request.goal_index
        self._poses, self._waypoints = poses, None
        if first >= len(poses):
            raise InvalidMessage(f'wanted waypoints from number {first} on, got {len(poses)}')
        goals = [self._in_map(pose) for pose in poses]
        self._waypoints = Waypoints(goals, first, request.number_of_loops + 1, self._end)
        self._navigation.follow(self._waypoints)

    def _feedback(self, frame: str) -> Any:
        if self._waypoints is None:
            return None
        return self._type.Feedback(current_waypoint=self._waypoints.index)

    def _fill(self, result: Any, outcome: Outcome) -> None:
        kind = self._type.Result
        missed = () if self._waypoints is None else self._waypoints.missed
        for index in missed:
            waypoint = importlib.import_module('nav2_msgs.msg').MissedWaypoint()
            waypoint.index, waypoint.goal = index, self._poses[index]
            waypoint.error_code = kind.UNKNOWN
            result.missed_waypoints.append(waypoint)
        if outcome.state != 'arrived':
            result.error_code = kind.UNKNOWN
            result.error_msg = ': '.join(filter(None, outcome))
