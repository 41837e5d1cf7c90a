# SPDX-License-Identifier: Apache-2.0
"""The action navigate_to_pose, as Nav2's clients know it."""

from collections.abc import Callable
import importlib
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import GoalEvent
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from wasd_core.errors import InvalidMessage
from wasd_core.timing import Beat

from wasd_navigation.messages import to_pose_stamped
from wasd_navigation.navigator import Navigator, Outcome

NAME = 'navigate_to_pose'
# So many requests wait until they are handled: of a hundred at once by default ten are answered.
REQUESTS = qos_profile_parameters
FEEDBACK_RATE = 10.0
# What error_code says of a goal that was not reached; 0 is none, as in Nav2.
NOT_REACHED = 1


def action_type() -> Any:
    """Return nav2_msgs/NavigateToPose, or None where nav2_msgs is not installed."""
    try:
        return importlib.import_module('nav2_msgs.action').NavigateToPose
    except ImportError:
        return None


class GoalAction:
    """
    Serves the action of a node; each goal that comes takes the place of the one before.

    `go` drives to what a message asks for, `stop` cancels, `stand` commands standstill. A goal
    that something else has ended is aborted, with the reason in `error_msg`.
    """

    def __init__(
        self,
        node: Node,
        navigator: Navigator,
        go: Callable[[PoseStamped], None],
        stop: Callable[[str], bool],
        stand: Callable[[], None],
    ) -> None:
        self._navigator = navigator
        self._node = node
        self._go, self._stop, self._stand = go, stop, stand
        self._handle: Any = None
        self._beat = Beat()
        self._type = action_type()
        self._server: Any = None
        if self._type is not None:
            # What is done with a goal is done by steps, and told here when it has ended.
            self._server = ActionServer(
                node,
                self._type,
                NAME,
                execute_callback=lambda handle: self._type.Result(),
                handle_accepted_callback=self._on_goal,
                cancel_callback=self._on_cancel,
                goal_service_qos_profile=REQUESTS,
                result_service_qos_profile=REQUESTS,
                cancel_service_qos_profile=REQUESTS,
            )
            navigator.on_end.append(self._on_end)

    def step(self, now: float, frame: str) -> None:
        """Tell how far it is, at a time [s]; poses are in a frame."""
        is_due = self._beat.is_due(now, FEEDBACK_RATE)
        pose, pilot = self._navigator.pose, self._navigator.pilot
        # Before the way is drawn nobody knows how long it is.
        if self._handle is None or pose is None or not is_due or not len(pilot.path):
            return
        feedback = self._type.Feedback(
            navigation_time=Duration(seconds=self._navigator.elapsed).to_msg(),
            estimated_time_remaining=Duration(seconds=pilot.time_left).to_msg(),
            number_of_recoveries=pilot.recoveries,
            distance_remaining=float(pilot.distance_left),
        )
        stamp = self._node.get_clock().now().to_msg()
        feedback.current_pose = to_pose_stamped(pose, stamp, frame)
        self._handle.publish_feedback(feedback)

    def close(self) -> None:
        """Serve no more."""
        if self._server is not None:
            self._server.destroy()

    def _on_goal(self, handle: Any) -> None:
        # Without a zero: it goes on to the next one, unless that is none.
        was_driving = self._navigator.cancel('another goal replaced it')
        self._handle = handle
        handle._update_state(GoalEvent.EXECUTE)  # `execute` would run to the end at once
        try:
            self._go(handle.request.pose)
        except InvalidMessage as error:
            self._navigator.refuse(str(error))
        if was_driving and self._navigator.goal is None:
            self._stand()

    def _on_cancel(self, handle: Any) -> CancelResponse:
        if handle is self._handle:
            self._stop('asked to')
        return CancelResponse.ACCEPT

    def _on_end(self, outcome: Outcome) -> None:
        """Tell the result after this handler: a cancel is noted after it."""
        handle, self._handle = self._handle, None
        if handle is not None:
            self._server.notify_execute(handle, lambda handle: self._finish(handle, outcome))

    def _finish(self, handle: Any, outcome: Outcome) -> Any:
        result = self._type.Result()
        if outcome.state == 'arrived':
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            result.error_code = NOT_REACHED
            result.error_msg = ': '.join(filter(None, outcome))
            handle.abort()
        return result
