# SPDX-License-Identifier: Apache-2.0
"""The diff-drive controller on ROS: cmd_vel in, odom and joint commands out."""

import math
import sys
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import load_robot
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import (
    to_base_state,
    to_base_transform,
    to_diagnostics,
    to_joint_commands,
    to_joint_state,
    to_odometry,
    to_seconds,
)
from wasd_core.ros_parameters import declare_parameters
from wasd_core.services import offer
from wasd_core.streams import visible
from wasd_core.timing import Beat, judge_stamp
from wasd_core.topics import (
    AbsenceWatch,
    has_listener,
    RELIABLE,
    SENSOR_DATA,
    TfBroadcaster,
    VelocitySubscription,
)
from wasd_core.velocity_messages import stamped, to_twist

from diff_drive_sim.controller_file import (
    ALIASES,
    ControllerFile,
    read_controller_file,
    translate,
    UNUSED,
)
from diff_drive_sim.drive import Controller, DiffDrive
from diff_drive_sim.odometry import DiffDriveError, PlanarCovariance
from diff_drive_sim.parameters import diff_drive_controller, DiffDriveParameters


def read_given(node: Node, file: ControllerFile | None = None) -> ControllerFile:
    """
    Read the file that the parameter `controller` names, if any, unless its content is given.

    ROS' parameters come before the file, under the names of this node. Parameters without a
    meaning here are said once, and taken out; the others are declared.

    Raises:
        InvalidParameter: what is wrong with the file, with its line.
    """
    overrides = node._parameter_overrides
    if 'mode' in overrides and overrides['mode'].value == '':
        del overrides['mode']  # how a launch file says nothing
    unused = {name for name in overrides if name in UNUSED - {'use_sim_time', 'type'}}
    for name, given in list(overrides.items()):
        outward, value = translate(name, given.value)
        if (outward, value) != (name, given.value):
            del overrides[name]
            overrides[outward] = Parameter(outward, value=value)
        elif name in unused:
            del overrides[name]
    path = overrides['controller'].value if 'controller' in overrides else ''
    if file is None and isinstance(path, str) and path:
        file = read_controller_file(path)
    file = file or ControllerFile({}, DiffDriveParameters(), '', ())
    if unused := unused | {*file.unused}:
        node.get_logger().info(f'parameters without a meaning here: {", ".join(sorted(unused))}')
    return file


# Truth that is farther apart than this says nothing of the speed in between [s].
LONGEST_LOOK = 0.5
ARBOTIX_JOINTS = ('base_l_wheel_joint', 'base_r_wheel_joint')


class DiffDriveControllerNode(Node):
    """
    The face of a drive: cmd_vel and parameters in, odom, /tf and diagnostics out.

    A drive that it is given is stepped by who made it, who also calls the `publish` methods, and
    may put another receiver in place of `cmd_vel.on_velocity`. Alone, it makes a drive by its
    parameters, steps it at each `joint_states` and publishes `joint_commands`; in mode fake it
    steps on a timer, and the wheels' `joint_states` are its own.
    """

    other_names = (*ALIASES, *UNUSED)  # of parameters that it takes

    def __init__(
        self,
        unit: DiffDrive | None = None,
        *,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
        file: ControllerFile | None = None,
    ) -> None:
        """
        Configure a drive by the parameters, or load the robot that these name.

        `file` is what the parameter `controller` names, where that was read before.

        Raises:
            InvalidParameter, DescriptionError, DiffDriveError: what is wrong, in one line.
        """
        super().__init__(
            'diff_drive_controller',
            namespace=namespace,
            parameter_overrides=parameter_overrides or [],
        )
        given = read_given(self, file)
        declared = declare_parameters(self, DiffDriveParameters, self._on_change, given.parameters)
        self._is_alone = unit is None
        if unit is None:
            loaded = load_robot(declared.description, wheels=declared.wheel_choice())
            # Over topics the answer to a state is in force from the next one on.
            unit = DiffDrive(loaded.robot, delay=1)
        self.unit = unit
        self.unit.configure(declared)
        for note in (*self.unit.notes, *self._frame_notes()):
            self.get_logger().warning(visible(note))
        self.unit.say = lambda text: self.get_logger().warning(visible(text))
        self._label = f'{self.get_namespace()}/{given.name or self.get_name()}'.strip('/')
        self._absence = AbsenceWatch(self, self._on_return)
        self.cmd_vel = VelocitySubscription(
            self, self._on_velocity, self._is_stale, self.settings.stamped, self._age_of
        )
        self._names = self._own_joint_names(alone=self.unit.is_fake and self._is_alone)
        self._make_publishers()
        offer(self, '~/reset_odometry', self._on_reset_odometry)
        self.create_subscription(
            PoseWithCovarianceStamped, '~/set_odometry', self._on_set_odometry, RELIABLE
        )
        if self._is_alone:
            self._stand_alone()

    @property
    def settings(self) -> DiffDriveParameters:
        """What is in force."""
        return self.unit.parameters

    @property
    def frames(self) -> tuple[str, str]:
        """The frames of odometry and of the base."""
        return self.settings.odom_frame_id, self.settings.base_frame_id

    @property
    def controller(self) -> Controller:
        """What commands become wheel speeds by."""
        return self.unit.controller

    def publish(self, stamp: Any = None) -> None:
        """Publish odom and /tf, and what else is asked for, with one stamp: the node's time."""
        self._absence.beat()
        stamp = stamp or self.get_clock().now().to_msg()
        if has_listener(self._odometry):
            self._odometry.publish(self.odometry(stamp))
        if self.settings.enable_odom_tf and self._tf.available:
            self._tf.send([to_base_transform(self.unit.odometry, *self.frames, stamp)])
        if self._limited is not None:
            frame = self.settings.base_frame_id
            linear, angular = self.controller.velocity
            self._limited.publish(stamped(to_twist(linear, 0.0, 0.0, angular), stamp, frame))
        if self._names and has_listener(self._wheel_states):
            repeat = len(self._names) // 2
            positions, velocities = (
                [*self.unit.flip(values)] * repeat
                for values in (self.unit.angles, self.unit.wheel_velocities)
            )
            self._wheel_states.publish(to_joint_state(self._names, stamp, positions, velocities))

    def odometry(self, stamp: Any = None) -> Odometry:
        """Return odom as `publish` would publish it."""
        stamp = stamp or self.get_clock().now().to_msg()
        return to_odometry(self.unit.odometry, *self.frames, stamp)

    def publish_diagnostics(self) -> None:
        """Publish the state, and what arbotix says of a controller."""
        stamp = self.get_clock().now().to_msg()
        (left, right), odometry = self.unit.ticks, self.controller.odometry_state
        values = {'Left': left, 'Right': right, 'dX': odometry.linear, 'dR': odometry.angular}
        texts = {name: str(value) for name, value in values.items()}
        state = self.controller.state
        self._diagnostics.publish(to_diagnostics(self._label, state, texts, stamp))

    def close(self) -> None:
        """Leave the wheels stopped (the simulator's own watchdog brakes them, too)."""
        self.unit.reset()

    def _make_publishers(self) -> None:
        self._odometry = self.create_publisher(Odometry, 'odom', RELIABLE)
        self._tf = TfBroadcaster(self)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self._limited: Any = None
        if self.settings.publish_limited_velocity:
            self._limited = self.create_publisher(TwistStamped, '~/cmd_vel_out', RELIABLE)
        if self._names:
            self._wheel_states = self.create_publisher(JointState, 'joint_states', RELIABLE)

    def _stand_alone(self) -> None:
        """Step on joint_states, or in mode fake on a timer of the node's clock."""
        self._stepped_at: float | None = None
        self._stepped_wall = time.monotonic()
        self._beat = Beat()
        if self.settings.diagnostic_rate > 0.0:
            self.create_timer(1.0 / self.settings.diagnostic_rate, self.publish_diagnostics)
        if self.unit.is_fake:
            self.create_timer(1.0 / self.unit.update_rate, self._on_fake_timer)
            return
        self._joint_commands = self.create_publisher(JointTrajectory, 'joint_commands', RELIABLE)
        self.create_subscription(JointState, 'joint_states', self._on_joint_states, SENSOR_DATA)
        self._looked_at = 0.0
        self.create_subscription(Odometry, 'ground_truth/odom', self._on_truth, SENSOR_DATA)

    def _on_fake_timer(self) -> None:
        now = self.get_clock().now()
        self._absence.beat()
        self.unit.step_fake(*self._elapsed(1e-9 * now.nanoseconds))
        self._publish_when_due(1e-9 * now.nanoseconds, now.to_msg())

    def _on_joint_states(self, message: JointState) -> None:
        geometry = self.controller.geometry
        names = (geometry.left_joint, geometry.right_joint)
        if not set(names) & set(message.name) and message.name:
            return  # somebody else's joints
        try:
            wheels = [message.position[message.name.index(name)] for name in names]
        except (ValueError, IndexError):
            self.get_logger().warning(
                f'joint_states lacks {geometry.left_joint} or {geometry.right_joint}: ignored',
                once=True,
            )
            return
        if not all(map(math.isfinite, wheels)):
            self.get_logger().warning(
                'joint_states: wanted finite wheel angles: ignored', throttle_duration_sec=5.0
            )
            return
        now = to_seconds(message.header.stamp)
        self._absence.beat()
        command = self.unit.control(wheels[0], wheels[1], *self._elapsed(now))
        self._joint_commands.publish(to_joint_commands(names, command, message.header.stamp))
        self._publish_when_due(now, message.header.stamp)

    def _on_truth(self, message: Odometry) -> None:
        """Look how fast the robot really is, which a simulator knows: whether its wheels slip."""
        if not self._is_base(message.child_frame_id):
            return  # somebody else's robot
        before, self._looked_at = self._looked_at, to_seconds(message.header.stamp)
        ahead, _, turn = to_base_state(message).planar_velocity.tolist()
        dt = self._looked_at - before
        if 0.0 < dt <= LONGEST_LOOK and math.isfinite(ahead) and math.isfinite(turn):
            self.unit.watch(ahead, turn, dt)

    def _elapsed(self, now: float) -> tuple[float, float]:
        """
        Return the time since the last call, and how much of it since the last command came [s].

        0 for the first, and when time jumps back. A command has no stamp, and the clock of the
        states need not be ours: when it came between two states is known by wall time.
        """
        if gap := self.cmd_vel.step():
            self._on_return(gap)
        previous, self._stepped_at = self._stepped_at, now
        wall_before, self._stepped_wall = self._stepped_wall, time.monotonic()
        dt = 0.0 if previous is None else max(now - previous, 0.0)
        wall = self._stepped_wall - wall_before
        since = self._stepped_wall - self.cmd_vel.came_at
        return dt, dt * min(since / wall, 1.0) if wall > 0.0 else 0.0

    def _publish_when_due(self, now: float, stamp: Any) -> None:
        if self._beat.is_due(now, self.settings.publish_rate):
            self.publish(stamp)

    def _is_stale(self, sent: int) -> bool:
        """Whether a command waited while this process stood still; without time-out none has."""
        is_stale = self._absence.is_stale(sent)
        return is_stale and self.settings.cmd_vel_timeout > 0.0

    def _on_return(self, gap: float) -> None:
        """Begin again after this process, or time, stood still: who wants what is not known."""
        # Where somebody else steps, robot and process stood still together.
        if self._is_alone and self.settings.cmd_vel_timeout > 0.0:
            was_driven = self.controller.state == 'driving'
            self.controller.forget_command()
            if was_driven:
                self.get_logger().warning(
                    f'was paused for {gap:.1f} s: stops until a new velocity comes'
                )

    def _on_velocity(self, velocity: tuple[float, float, float], age: float) -> bool:
        linear, _, angular = velocity
        if not self.controller.command(linear, angular, age):
            self.get_logger().warning(
                f'cmd_vel is not finite (linear.x {linear}, angular.z {angular}): ignored',
                once=True,
            )
        return True

    def _age_of(self, stamp: Time) -> float | None:
        """Return how old a command is [s], None for one to be dropped, and tell what is odd."""
        now, sent = to_seconds(self.get_clock().now().to_msg()), to_seconds(stamp)
        verdict = judge_stamp(sent, now, self.settings.cmd_vel_timeout)
        if verdict.age is None:
            self.get_logger().warning(f'cmd_vel {verdict.note}', throttle_duration_sec=1.0)
        elif verdict.note and sent == 0.0:
            self.get_logger().warning(f'cmd_vel {verdict.note}', once=True)
        elif verdict.note:
            self.get_logger().warning(f'cmd_vel {verdict.note}', throttle_duration_sec=5.0)
        return verdict.age

    def _on_reset_odometry(self) -> tuple[bool, str]:
        self.controller.set_odometry(0.0, 0.0, 0.0, PlanarCovariance())
        return True, f'odometry is at the origin of {self.settings.odom_frame_id}'

    def _on_set_odometry(self, message: PoseWithCovarianceStamped) -> None:
        try:
            pose = _from_pose(message, self.settings.odom_frame_id)
        except DiffDriveError as error:
            self.get_logger().warning(f'set_odometry: {error}: ignored')
            return
        self.controller.set_odometry(*pose)

    def _on_change(self, changed: DiffDriveParameters) -> None:
        self.unit.parameters = changed

    def _frame_notes(self) -> list[str]:
        robot, frame = self.unit.robot, self.settings.base_frame_id
        if self._is_base(frame) or not self.settings.enable_odom_tf:
            return []
        why = 'has a parent already' if frame in robot.links else 'is no link of the description'
        root = robot.root
        return [f'base_frame_id {frame!r} {why}, it moves with {root!r}: /tf is no tree']

    def _is_base(self, frame: str) -> bool:
        """Whether a frame is the root; a robot's prefix may be before it, or in its name."""
        return f'/{frame}'.endswith(f'/{self.unit.robot.root}')

    def _own_joint_names(self, alone: bool) -> tuple[str, ...]:
        """Return the names under which this node publishes the wheels' states; none if others."""
        geometry, wanted = self.controller.geometry, self.settings.joint_names
        described = (geometry.left_joint, geometry.right_joint)
        if described == ARBOTIX_JOINTS:
            return described if alone else ()
        names = described if alone and wanted != 'arbotix' else ()
        return names if wanted == 'urdf' else (*names, *ARBOTIX_JOINTS)


def _from_pose(
    message: PoseWithCovarianceStamped, frame: str
) -> tuple[float, float, float, PlanarCovariance]:
    """
    Return x, y [m], yaw [rad] and their covariance.

    Raises:
        DiffDriveError: the pose is in another frame than `frame`, or is no pose.
    """
    if message.header.frame_id not in ('', frame):
        raise DiffDriveError(
            f'wanted a pose in frame {frame!r}, got one in {message.header.frame_id!r}'
        )
    position, q = message.pose.pose.position, message.pose.pose.orientation
    c = message.pose.covariance
    numbers = (position.x, position.y, q.x, q.y, q.z, q.w, *c)
    if not all(map(math.isfinite, numbers)) or q.x == q.y == q.z == q.w == 0.0:
        raise DiffDriveError('wanted a pose of finite numbers and an orientation that is not 0')
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    return position.x, position.y, yaw, PlanarCovariance(c[0], c[1], c[7], c[5], c[11], c[35])


if __name__ == '__main__':
    sys.exit(diff_drive_controller())
