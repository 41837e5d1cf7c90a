# SPDX-License-Identifier: Apache-2.0
"""The navigator on ROS: scan, odom and goal_pose in; map, map -> odom, plan and cmd_vel out."""

import functools
import math
import sys
import time
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String
from wasd_core.errors import InvalidMessage, UserError
from wasd_core.messages import from_odometry, to_seconds
from wasd_core.ros_parameters import declare_parameters
from wasd_core.services import offer
from wasd_core.streams import visible
from wasd_core.timing import SHORTEST_ABSENCE
from wasd_core.topics import (
    AbsenceWatch,
    BEAT_PERIOD,
    LATCHED,
    PublisherWatch,
    RELIABLE,
    SENSOR_DATA,
)
from wasd_core.velocity_messages import stamped, to_twist

from wasd_navigation.actions import FollowWaypoints, NavigateToPose
from wasd_navigation.messages import from_pose, hear_fixed_frames, NavigationPublisher, take_scan
from wasd_navigation.navigator import Navigator
from wasd_navigation.odometry import read_covariance, to_planar
from wasd_navigation.parameters import navigator, NavigatorParameters
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose

# Locks of the mux that stop navigation, and the name of its source.
LOCKS = ('pause_navigation', 'e_stop')
SOURCE = 'navigation'
# A mux that relays another source, or none, for so long does not relay us [s].
HEARD_WITHIN = 0.5


class NavigatorNode(Node):
    """
    The face of a robot's navigator: scan, odom and goals in; map, plan, pose and cmd_vel out.

    The owner of a given `navigation` gives it odometry and scans, takes its commands, steps it and
    calls `publish`. Alone, it makes one by its parameters, takes sensors from topics, publishes
    velocities and steps on a timer of its clock.

    Raises:
        UserError: a parameter is not valid, or the map cannot be read.
    """

    def __init__(
        self,
        navigation: RobotNavigator | None = None,
        *,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        super().__init__(
            'navigator', namespace=namespace, parameter_overrides=parameter_overrides or []
        )
        settings = declare_parameters(
            self, NavigatorParameters, lambda changed: self.navigation.tune(changed)
        )
        self.navigation = navigation or RobotNavigator(settings, inform=self._log)
        self.navigation.configure(settings)
        self.navigation.warn = self._warn
        self._selected: str | None = None  # by the mux; None: there is none
        self._unheard = 0.0  # for so long velocities were sent that nobody relays [s]
        self._publisher = NavigationPublisher(self, self.navigator, settings.map_frame)
        self.navigation.on_reset.append(self._publisher.forget)
        self.navigation.on_scan.append(self._publisher.publish_pose)
        # A run in lock-step may be late: its goals go on.
        on_return = (self._on_return,) if navigation is None else ()
        self._absence = AbsenceWatch(self, *on_return)
        self._listen()
        offer(self, '~/save_map', self._on_save_map)
        offer(self, '~/reset', self._on_reset)
        offer(self, '~/cancel', self._on_cancel)
        offer(self, '~/explore', self._on_explore)
        kinds = (NavigateToPose, FollowWaypoints)
        self._actions = [kind(self, self.navigation, self.in_map) for kind in kinds]
        if navigation is None:
            self._stand_alone()

    @property
    def navigator(self) -> Navigator:
        """What maps, and drives to a goal."""
        return self.navigation.navigator

    @property
    def settings(self) -> NavigatorParameters:
        """What is in force."""
        return self.navigation.settings

    def _listen(self) -> None:
        """Take what people say."""
        on_goal: Any = self._on_goal  # rclpy's types know no callback of two parameters
        self.create_subscription(PoseStamped, 'goal_pose', on_goal, RELIABLE)
        self.create_subscription(
            PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, RELIABLE
        )
        for lock in LOCKS:
            on_lock = functools.partial(self._on_lock, lock)
            self.create_subscription(Bool, lock, on_lock, RELIABLE)

    def _stand_alone(self) -> None:
        """Take sensors from topics, give velocities to one, and step on a timer."""
        self.navigation.send, self.navigation.say = self._publish_velocity, self._log
        kind = TwistStamped if self.settings.stamped else Twist
        self._velocity = self.create_publisher(kind, 'cmd_vel', RELIABLE)
        self.create_subscription(OdometryMessage, 'odom', self._on_odometry, SENSOR_DATA)
        self.create_subscription(LaserScan, 'scan', self._on_scan, SENSOR_DATA)
        self.create_subscription(String, 'selected', self._on_selected, LATCHED)
        self._mux_watch = PublisherWatch(self, 'selected', self._on_mux_lost)
        hear_fixed_frames(self, self.navigation.senses)
        self.create_timer(1.0 / self.settings.control_frequency, self.step)
        self._ticked = math.nan, 0.0  # the node's time, and since when by the wall's [s]
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(BEAT_PERIOD, lambda: self._look_at_time(time.monotonic()), clock=wall)

    def step(self) -> None:
        """Let the navigator step to the time of the node's clock, and publish what has changed."""
        now = 1e-9 * self.get_clock().now().nanoseconds
        dt = self.navigation.step(now)
        if dt is not None:
            self.publish(now, dt)

    def _look_at_time(self, wall: float) -> None:
        """Stop once where time stands still, as in a simulator that is paused."""
        now, (before, since) = 1e-9 * self.get_clock().now().nanoseconds, self._ticked
        if now != before:
            self._ticked = now, wall
        elif wall - since > SHORTEST_ABSENCE:
            self._ticked = now, math.inf  # a goal that comes meanwhile waits for time to go on
            self.navigation.stop('time stands still: is the simulator paused?')

    def publish(self, now: float, dt: float) -> None:
        """Publish what has changed up to a time [s], `dt` [s] after the last call."""
        self._look_who_is_heard(dt)
        dated = now + self.settings.transform_tolerance
        self._publisher.publish(now, dated, self.navigation.senses.odom_frame)
        for action in self._actions:
            action.step(now, self.settings.map_frame)

    def close(self) -> None:
        """Leave the robot standing."""
        self.navigation.stop('the navigator ends')

    def destroy_node(self) -> None:
        """Release the node, and the actions' servers."""
        for action in self._actions:
            action.close()
        super().destroy_node()

    def _publish_velocity(self, velocity: np.ndarray) -> None:
        stamp = self.get_clock().now().to_msg() if self.settings.stamped else None
        vx, vy, wz = velocity.tolist()
        self._velocity.publish(
            stamped(to_twist(vx, vy, 0.0, wz), stamp, self.navigation.senses.base_frame)
        )

    def _on_odometry(self, message: OdometryMessage) -> None:
        """Take odometry whose stamp may be missing or wrong."""
        now = to_seconds(message.header.stamp)
        if self.navigation.senses.age(now) == 0.0:
            self._warn('odom: the same stamp again: ignored')
        frames = message.header.frame_id, message.child_frame_id
        self.navigation.take_odometry(now, from_odometry(message), frames)

    def _on_scan(self, message: LaserScan) -> None:
        take_scan(message, self.navigation.senses)

    def _on_goal(self, message: PoseStamped, info: dict[str, int]) -> None:
        try:
            if self._absence.is_stale(info['source_timestamp']):
                raise InvalidMessage('it waited while this process stood still')
            self.navigation.go(self.in_map(message))
        except InvalidMessage as error:
            self._refuse(f'goal_pose: {error}: ignored')

    def in_map(self, message: PoseStamped) -> np.ndarray:
        """
        Return a pose in the map, shape (3,).

        Raises:
            InvalidMessage: it is no pose, or in a frame from which no way leads to the map.
        """
        goal, frame = to_planar(from_pose(message.pose)), message.header.frame_id.lstrip('/')
        navigator, known = self.navigator, {}
        # A map that begins with the robot is where odometry is.
        begins = navigator.is_mapping and getattr(navigator.locator, 'is_found', True)
        if navigator.is_placed or begins:
            known[self.navigation.senses.odom_frame.lstrip('/')] = navigator.locator.correction
            if navigator.pose is not None:
                known[self.navigation.senses.base_frame.lstrip('/')] = navigator.pose
        # Last: no robot's frame is the map's, whatever it is called.
        known[''] = known[self.settings.map_frame.lstrip('/')] = np.zeros(3)
        if frame not in known:
            names = ' or '.join(map(repr, filter(None, reversed(known))))
            raise InvalidMessage(f'wanted a pose in {names}, got {frame!r}')
        return np.asarray(compose(known[frame], goal))

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            start = getattr(self.navigator.locator, 'start', None)
            if start is None:
                raise InvalidMessage('it needs a saved map, but this robot makes its own')
            pose = self.in_map(PoseStamped(header=message.header, pose=message.pose.pose))
            if not self.navigator.locator.grid.has(pose[:2]):
                raise InvalidMessage(f'({pose[0]:.2f}, {pose[1]:.2f}) is outside the map')
            start(pose, read_covariance(np.array(message.pose.covariance).reshape(6, 6)))
        except InvalidMessage as error:
            self._refuse(f'initialpose: {error}: ignored')

    def _on_lock(self, lock: str, message: Bool) -> None:
        self.navigation.lock(lock, message.data)

    def _on_selected(self, message: String) -> None:
        """Give way to the source that the mux has selected."""
        before, self._selected = self._selected, message.data
        if message.data not in ('', SOURCE) or (before == SOURCE and not message.data):
            self.navigation.stop(f'{message.data or "a lock"} takes over')

    def _on_mux_lost(self) -> None:
        """Begin without a goal when somebody starts it again."""
        self._selected = None
        self.navigation.stop('the mux is gone')

    def _look_who_is_heard(self, dt: float) -> None:
        """Stop when the mux does not relay us: the robot would drive off when that changes."""
        is_relayed = self._selected in (None, SOURCE)
        self._unheard = 0.0 if is_relayed or self.navigator.goal is None else self._unheard + dt
        if self._unheard > HEARD_WITHIN:
            self._unheard = 0.0
            self.navigation.stop(f'the mux lets {self._selected or "nobody"} drive')

    def _on_return(self, gap: float) -> None:
        """Begin without a goal after this process stood still: the old one is out of date."""
        self.navigation.stop(f'was paused for {gap:.1f} s')

    def _on_save_map(self) -> tuple[bool, str]:
        try:
            return True, self.navigation.save_map(self.settings.save_map)
        except UserError as error:
            return False, str(error)

    def _on_reset(self) -> tuple[bool, str]:
        self.navigation.begin_map()
        return True, 'a new map begins'

    def _on_cancel(self) -> tuple[bool, str]:
        had_goal = self.navigation.stop('asked to')
        return had_goal, 'the robot stands' if had_goal else 'there was no goal'

    def _on_explore(self) -> tuple[bool, str]:
        try:
            self.navigation.explore()
        except UserError as error:
            return False, str(error)
        return True, 'explores'

    def _log(self, words: str) -> None:
        self.get_logger().info(visible(words))

    def _refuse(self, words: str) -> None:
        """Tell the driver, if there is one, and the log."""
        if self.navigation.say != self._log:
            self.navigation.say(words)
        self._warn(words)

    def _warn(self, words: str) -> None:
        self.get_logger().warning(visible(words), throttle_duration_sec=5.0)


if __name__ == '__main__':
    sys.exit(navigator())
