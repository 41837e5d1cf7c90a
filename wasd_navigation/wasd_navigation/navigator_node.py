# SPDX-License-Identifier: Apache-2.0
"""The navigator on ROS: scan, odom and goal_pose in; map, map -> odom, plan and cmd_vel out."""

from collections.abc import Callable
import functools
import pathlib
import sys
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from wasd_core.errors import InvalidMessage, UserError
from wasd_core.messages import to_seconds
from wasd_core.node import run_node
from wasd_core.ros_parameters import declare_parameters
from wasd_core.rotations import Pose
from wasd_core.streams import visible
from wasd_core.topics import (
    AbsenceWatch,
    LATCHED,
    PublisherWatch,
    RELIABLE,
    SENSOR_DATA,
    tf_message_type,
    TF_STATIC,
)

from wasd_navigation.goal_action import GoalAction
from wasd_navigation.mapping import save_map
from wasd_navigation.messages import (
    from_covariance,
    from_odometry,
    from_pose,
    from_scan,
    NavigationPublisher,
    to_planar,
)
from wasd_navigation.navigator import Navigator, Outcome
from wasd_navigation.odometry import OdometryMemory
from wasd_navigation.parameters import navigator, NavigatorParameters
from wasd_navigation.parts import make_parts, make_pilot, Parts
from wasd_navigation.se2 import compose

# Locks of the mux that stop navigation, and the name of its source.
LOCKS = ('pause_navigation', 'e_stop')
SOURCE = 'navigation'
# A mux that relays somebody else, or nobody, for so long does not relay us [s].
HEARD_WITHIN = 0.5


class NavigatorNode(Node):
    """
    Maps or localises, and drives to one goal at a time.

    Alone it steps on a timer of its clock. In lock-step the simulation loop hands odometry over
    by `take_odometry`, scans by `take_scan`, and calls `step`; `send` takes what is commanded,
    `say` what is said to a driver. `parts` are what maps and what drives, where parameters are
    not to make them.

    Raises:
        UserError: a parameter is not valid, or the map cannot be read.
    """

    def __init__(
        self,
        *,
        lock_step: bool = False,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
        parts: Parts | None = None,
    ) -> None:
        super().__init__(
            'navigator', namespace=namespace, parameter_overrides=parameter_overrides or []
        )
        self.settings = declare_parameters(self, NavigatorParameters, self._on_change)
        parts = parts or make_parts(self.settings, self._log)
        self.navigator = Navigator(*parts, self.settings.planning.silence)
        self.navigator.on_end.append(self._on_end)
        self._odom_frame, self._base_frame = 'odom', ''
        self._memory = OdometryMemory()
        self._waiting: tuple[LaserScan, str] | None = None  # for odometry, and its frame
        self._notice = ''
        self._fixed: dict[str, tuple[str, Pose]] = {}  # child: parent and the pose in it
        self._locked: set[str] = set()
        self._selected: str | None = None  # by the mux; None: there is none
        self._unheard = 0.0  # for so long velocities were sent that nobody relays [s]
        self._publisher = NavigationPublisher(self, self.navigator, self.settings.map_frame)
        self._listen()
        self.create_service(Trigger, '~/save_map', self._on_save_map)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(Trigger, '~/cancel', self._on_cancel)
        self.send: Callable[[np.ndarray], None] = self._publish_velocity
        self.say: Callable[[str], Any] = self._log
        self.refusal: Callable[[], str] = lambda: ''  # why nothing can be driven to now
        self._action = GoalAction(self, self.navigator, self._go_to, self.stop, self.stand)
        self._stepped_at: float | None = None
        if not lock_step:
            self._stand_alone()

    def _listen(self) -> None:
        """Take what people say."""
        self.create_subscription(PoseStamped, 'goal_pose', self._on_goal, RELIABLE)
        self.create_subscription(
            PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, RELIABLE
        )
        for lock in LOCKS:
            on_lock = functools.partial(self._on_lock, lock)
            self.create_subscription(Bool, lock, on_lock, RELIABLE)

    def _stand_alone(self) -> None:
        """Take sensors from topics, give velocities to one, and step on a timer."""
        kind = TwistStamped if self.settings.stamped else Twist
        self._velocity = self.create_publisher(kind, 'cmd_vel', RELIABLE)
        self._absence = AbsenceWatch(self, self._on_return)
        self.create_subscription(OdometryMessage, 'odom', self._on_odometry, SENSOR_DATA)
        self.create_subscription(LaserScan, 'scan', self.take_scan, SENSOR_DATA)
        self.create_subscription(String, 'selected', self._on_selected, LATCHED)
        self._mux_watch = PublisherWatch(self, 'selected', self._on_mux_lost)
        tf = tf_message_type()
        if tf is not None:
            self.create_subscription(tf, '/tf_static', self._on_fixed_frames, TF_STATIC)
        self.create_timer(1.0 / self.settings.control_frequency, self.step)

    def place_frame(self, child: str, parent: str, pose: Pose) -> None:
        """Take where a frame is that never moves in its parent: the lidar's is such a one."""
        self._fixed[child.lstrip('/')] = parent.lstrip('/'), pose

    def take_odometry(self, message: OdometryMessage) -> None:
        """Take where the base is in the odom frame."""
        try:
            odometry = from_odometry(message)
        except InvalidMessage as error:
            self._warn(f'odom: {error}: ignored')
            return
        self._odom_frame = message.header.frame_id or self._odom_frame
        self._base_frame = message.child_frame_id or self._base_frame
        stamp = to_seconds(message.header.stamp)
        if self._memory.age(stamp) == 0.0:
            return  # said before: no sign of life
        if self.navigator.move(odometry):
            self._memory.clear()
            self._warn('odom: has leapt, as if it was set anew')
            self.stop('odometry has leapt')
        self._memory.add(stamp, odometry)
        if self._waiting is not None:
            late, self._waiting = self._waiting, None
            self.take_scan(*late)

    def take_scan(self, message: LaserScan, frame: str = '') -> None:
        """Take a scan, of the frame that it names or another; it waits for odometry."""
        mount = self._mount_of(frame or message.header.frame_id)
        stamp = to_seconds(message.header.stamp)
        odometry, age = self._memory.at(stamp), self._memory.age(stamp)
        if odometry is None and age > 0.0:
            self._warn(f'scan is {age:.1f} s old, before all odometry that is kept: ignored')
        elif odometry is None:
            self._waiting = message, frame
            if age < -1.0:
                self._warn(f'scan is {-age:.1f} s ahead of odometry: it waits')
        elif mount is not None:
            try:
                scan = from_scan(message, odometry.level @ mount)
            except InvalidMessage as error:
                self._warn(f'scan: {error}: ignored')
                return
            self.navigator.see(scan, odometry, age)
            self._publisher.publish_pose(odometry, message.header.stamp)

    def step(self) -> None:
        """Command a velocity where there is a goal, and publish what has changed."""
        now = 1e-9 * self.get_clock().now().nanoseconds
        before, self._stepped_at = self._stepped_at, now
        dt = 0.0 if before is None else now - before
        if dt < 0.0:
            self.reset(f'time has jumped back by {-dt:.3g} s')
            return
        if self.navigator.goal is not None and (why := self.refusal()):
            self.stop(why)
        velocity = self.navigator.step(dt)
        if velocity is not None:
            self.send(velocity)
        self._look_who_is_heard(dt)
        if self._notice != (notice := self.navigator.notice):
            self._notice = notice
            if notice:
                self.say(notice)
        dated = now + self.settings.transform_tolerance
        self._publisher.publish(now, dated, self._odom_frame)
        self._action.step(now, self.settings.map_frame)

    def go(self, goal: np.ndarray) -> None:
        """Drive to T_map_goal, shape (3,), whose yaw may be NaN: see `Navigator.set_goal`."""
        refusal = ' and '.join(f'{lock} is on' for lock in sorted(self._locked)) or self.refusal()
        if refusal:
            self.stop('another goal has come')
            self.navigator.refuse(refusal, goal)
        else:
            self.navigator.set_goal(goal)

    def stop(self, why: str) -> bool:
        """Cancel the goal and command standstill; return whether there was a goal."""
        was_driving = self.navigator.cancel(why)
        if was_driving:
            self.stand()
        return was_driving

    def stand(self) -> None:
        """Command standstill."""
        self.send(np.zeros(3))

    def reset(self, why: str = 'the robot was put back to its start') -> None:
        """Stand and begin anew, because of something."""
        self.stop(why)
        self.navigator.reset()
        self._memory.clear()
        self._publisher.forget()
        self._waiting = self._stepped_at = None

    def close(self) -> None:
        """Leave the robot standing."""
        self.stop('the navigator ends')

    def destroy_node(self) -> None:
        """Release the node, and the action's server."""
        self._action.close()
        super().destroy_node()

    def _mount_of(self, frame: str) -> Pose | None:
        """Return the pose of the lidar's frame in the base, None where it is not known yet."""
        frame, pose = frame.lstrip('/'), Pose(np.zeros(3), np.eye(3))
        begin, base = frame, self._base_frame.lstrip('/')
        if not base:
            # Scans may come before odom: a word only where that lasts.
            self.get_logger().warning(
                'scan waits for odom, which names the base',
                throttle_duration_sec=5.0,
                skip_first=True,
            )
            return None
        for _ in range(len(self._fixed) + 1):  # no more: frames may go round in a circle
            if frame == base:
                return pose
            if frame not in self._fixed:
                break
            frame, step = self._fixed[frame]
            pose = step @ pose
        self._warn(f'scan waits: no way from {begin!r} to the base {base!r} on /tf_static')
        return None

    def _publish_velocity(self, velocity: np.ndarray) -> None:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = map(float, velocity)
        if self.settings.stamped:
            message = TwistStamped(twist=twist)
            message.header.stamp = self.get_clock().now().to_msg()
            message.header.frame_id = self._base_frame
            self._velocity.publish(message)
        else:
            self._velocity.publish(twist)

    def _on_odometry(self, message: OdometryMessage) -> None:
        """Take odometry of somebody who may not know what stamps are for."""
        if self._memory.age(to_seconds(message.header.stamp)) == 0.0:
            self._warn('odom: the same stamp again: ignored')
        self.take_odometry(message)

    def _on_fixed_frames(self, message: Any) -> None:
        for one in message.transforms:
            try:
                pose = from_pose(one.transform)
            except InvalidMessage as error:
                self._warn(f'/tf_static: {one.child_frame_id!r}: {error}: ignored')
                continue
            self.place_frame(one.child_frame_id, one.header.frame_id, pose)

    def _go_to(self, message: PoseStamped) -> None:
        self.go(self.in_map(message))

    def _on_goal(self, message: PoseStamped) -> None:
        try:
            self._go_to(message)
        except InvalidMessage as error:
            self.say(f'goal_pose: {error}: ignored')

    def in_map(self, message: PoseStamped) -> np.ndarray:
        """
        Return a pose in the map, shape (3,).

        Raises:
            InvalidMessage: it is no pose, or in a frame from which no way leads to the map.
        """
        goal, frame = to_planar(from_pose(message.pose)), message.header.frame_id.lstrip('/')
        known = {self._odom_frame.lstrip('/'): self.navigator.locator.correction}
        if self.navigator.pose is not None:
            known[self._base_frame.lstrip('/')] = self.navigator.pose
        # Last: no robot's frame is the map's, whatever it is called.
        known[''] = known[self.settings.map_frame.lstrip('/')] = np.zeros(3)
        if frame not in known:
            raise InvalidMessage(f'wanted a pose in {self.settings.map_frame!r}, got {frame!r}')
        return np.asarray(compose(known[frame], goal))

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            start = getattr(self.navigator.locator, 'start', None)
            if start is None:
                raise InvalidMessage('it is for a robot with a map, this one is making its own')
            pose = self.in_map(PoseStamped(header=message.header, pose=message.pose.pose))
            if not self.navigator.locator.grid.has(pose[:2]):
                raise InvalidMessage(f'({pose[0]:.2f}, {pose[1]:.2f}) is outside the map')
            start(pose, from_covariance(message.pose.covariance))
        except InvalidMessage as error:
            self.say(f'initialpose: {error}: ignored')

    def _on_lock(self, lock: str, message: Bool) -> None:
        (self._locked.add if message.data else self._locked.discard)(lock)
        if message.data:
            self.stop(f'{lock} is on')

    def _on_selected(self, message: String) -> None:
        """Give way to whom the mux lets drive instead."""
        before, self._selected = self._selected, message.data
        if message.data not in ('', SOURCE) or (before == SOURCE and not message.data):
            self.stop(f'{message.data or "a lock"} takes over')

    def _on_mux_lost(self) -> None:
        """Begin without a goal when somebody starts it again."""
        self._selected = None
        self.stop('the mux is gone')

    def _look_who_is_heard(self, dt: float) -> None:
        """Stop who speaks to a mux that does not listen: it would drive off when that changes."""
        is_relayed = self._selected in (None, SOURCE)
        self._unheard = 0.0 if is_relayed or self.navigator.goal is None else self._unheard + dt
        if self._unheard > HEARD_WITHIN:
            self._unheard = 0.0
            self.stop(f'the mux lets {self._selected or "nobody"} drive')

    def _on_return(self, gap: float) -> None:
        """Begin without a goal after this process stood still: nobody knows who wants it."""
        self.stop(f'stood still for {gap:.1f} s')

    def _on_end(self, outcome: Outcome) -> None:
        self.say(': '.join(filter(None, (f'goal {outcome.state}', outcome.reason))))

    def _on_save_map(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message = self.save_map(self.settings.save_map)
            response.success = True
        except UserError as error:
            response.message = str(error)
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.stop('the map begins anew')
        self.navigator.reset()
        self._publisher.forget()
        response.success, response.message = True, 'the map begins anew'
        return response

    def _on_cancel(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.stop('asked to')
        response.message = 'the robot stands' if response.success else 'there was no goal'
        return response

    def save_map(self, name: str) -> str:
        """
        Write the map to NAME.yaml and NAME.pgm; return words that say so.

        Raises:
            UserError: there is none yet, or it cannot be written.
        """
        if not self.navigator.scans:
            raise UserError('no map yet: no scan has come')
        text, picture = save_map(self.navigator.locator.grid, pathlib.Path(name))
        return f'map in {text} and {picture.name}'

    def _on_change(self, changed: NavigatorParameters) -> None:
        """Take other parameters; what drives is made anew, and stands before."""
        before, self.settings = self.settings, changed
        if (before.limits, before.planning) != (changed.limits, changed.planning):
            self.stop('how to drive has changed')
            self.navigator.configure(make_pilot(changed), changed.planning.silence)

    def _log(self, words: str) -> None:
        self.get_logger().info(visible(words))

    def _warn(self, words: str) -> None:
        self.get_logger().warning(visible(words), throttle_duration_sec=5.0)


def main(args: list[str] | None = None) -> int:
    """Run the navigator as a process of its own."""
    return run_node(NavigatorNode, args, joins=True, program=navigator)


if __name__ == '__main__':
    sys.exit(main())
