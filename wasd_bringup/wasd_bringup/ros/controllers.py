# SPDX-License-Identifier: Apache-2.0
"""The face of a robot's controller on ROS: keys and velocities in, odometry out."""

from collections.abc import Callable, Mapping
import functools
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from wasd_core.messages import to_stamp
from wasd_core.topics import EVENTS, LATCHED, LoopbackSubscription, RELIABLE, VelocitySubscription
from wasd_core.velocity_messages import stamped, to_twist

from wasd_bringup.run.mbot import Mbot
from wasd_bringup.run.robot import FullVelocity, Robot

# The last zeros may take so long to leave the process [s].
LAST_WORDS_TIMEOUT = 0.25
# So often a state is looked at [s].
STATE_PERIOD = 0.02


def overrides(values: Mapping[str, Any]) -> list[Parameter]:
    """Return values by name as what overrides the parameters of a node."""
    return [Parameter(name, value=value) for name, value in values.items()]


class ControllerFace:
    """
    A controller without a node of its own: cmd_vel and keys drive it, as `Drivers` allow.

    It publishes obeyed velocities on cmd_vel, and drops its own messages that come back.
    """

    # Whether its nodes stamp by their clocks, other than in what they answer to messages.
    needs_clock = True

    def __init__(self, robot: Robot, node: Any = None) -> None:
        """Take a robot, and the node of its controller, which has `cmd_vel`."""
        self.robot, namespace = robot, robot.options.namespace
        if node is None:  # this controller has none
            node = Node(robot.kind.controller, namespace=namespace)
            node.cmd_vel = VelocitySubscription(node, functools.partial(robot.follow, 'cmd_vel'))
        self.node = node
        twist_type = self.node.cmd_vel.type
        self.nodes: list[Node] = [self.node]
        self.key_inputs: list[LoopbackSubscription[String]] = []
        if robot.logic is not None:
            # A participant knows one type per topic: that of the controller's subscription.
            given = {name: getattr(robot.options, name) for name in ('preset', 'layout')}
            given['stamped'] = twist_type is TwistStamped
            teleop = KeysToTwistNode(
                robot.logic, namespace=namespace, parameter_overrides=overrides(given)
            )
            self.nodes.append(teleop)
            self.key_inputs.append(teleop.keys)
        self._twists = self.nodes[-1].create_publisher(twist_type, 'cmd_vel', RELIABLE)
        self.command_topic: str = self._twists.topic_name  # of velocities, by its full name
        robot.on_velocity.append(self._tell_velocity)

    def admit(self) -> None:
        """Ask the robot whether a key of another process counts, and give it the velocities."""
        robot = self.robot

        def admit_key(topic: str, message: String) -> bool:
            is_e_stop = robot.heeds_e_stop(message.data, f'topic {topic}')
            is_key = bool(message.data) and not is_e_stop
            return is_key and robot.take_topic(topic, key=message.data)

        for subscription in self.key_inputs:
            subscription.admit = functools.partial(admit_key, subscription.topic)
        self.node.cmd_vel.on_velocity = functools.partial(robot.follow, self.command_topic)

    def expect_key(self, key: str) -> None:
        """Drop the echo of a key that is being published."""
        for subscription in self.key_inputs:
            subscription.expect(String(data=key))

    def on_e_stop(self, stop: Callable[[], None]) -> None:
        """Let the controller's own e-stop service, if it has one, stop the run."""

    def odometry(self) -> Odometry | None:
        """Return odom as it is published in this instant; None before there is any."""
        return None

    def schedule(self, schedule: Any) -> None:
        """Publish on a schedule."""

    def flush(self) -> None:
        """Give the last velocities the time to leave the process."""
        self._twists.wait_for_all_acked(Duration(seconds=LAST_WORDS_TIMEOUT))

    def _tell_velocity(self, told: FullVelocity) -> None:
        message = self._to_message(told)
        self.node.cmd_vel.expect(message)
        self._twists.publish(message)

    def _to_message(self, told: FullVelocity) -> Any:
        return to_twist(*told)


class LegsFace(ControllerFace):
    """A quadruped's leg controller on ROS."""

    needs_clock = False

    def __init__(self, robot: Any) -> None:
        # Here, because wheels do without.
        from quadruped_sim.leg_controller_node import LegControllerNode

        given = overrides(robot.given)
        node = LegControllerNode(
            robot.legs, namespace=robot.options.namespace, parameter_overrides=given
        )
        super().__init__(robot, node)
        node.on_press = robot.press_state  # which knows the layout
        self.key_inputs.insert(0, node.keys)
        robot.elevation.wanted_by.append(lambda: node.heights.is_wanted)
        robot.elevation.on_map.append(
            lambda elevation, now: node.tell_heights(elevation, to_stamp(now))
        )
        if robot.options.interactive:
            # What it refuses is in the status line; a log would break that line.
            node.get_logger().set_level(LoggingSeverity.ERROR)

    def on_e_stop(self, stop: Callable[[], None]) -> None:
        """Let the controller's own e-stop service stop the run, and tell how a stop ends."""

        def stop_and_tell() -> str:
            stop()
            return self.robot.stop_words

        self.node.on_e_stop = stop_and_tell

    def odometry(self) -> Odometry | None:
        """Return odom as it is published in this instant; None before there is any."""
        odometry: Odometry | None = self.node.odometry(to_stamp(self.robot.world.time))
        return odometry

    def schedule(self, schedule: Any) -> None:
        """Publish on a schedule."""
        world, period = self.robot.world, 1.0 / self.node.legs.settings.publish_rate
        schedule.every(period, lambda: self.node.publish(to_stamp(world.time)))


class WheelsFace(ControllerFace):
    """A drive controller on ROS."""

    def __init__(self, robot: Mbot) -> None:
        # Here, because legs do without.
        from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode

        node = DiffDriveControllerNode(
            robot.drive_unit,
            namespace=robot.options.namespace,
            parameter_overrides=overrides(robot.given),
            file=robot.options.drive_file,
        )
        super().__init__(robot, node)

    def odometry(self) -> Odometry | None:
        """Return odom as it is published in this instant."""
        odometry: Odometry = self.node.odometry()
        return odometry

    def schedule(self, schedule: Any) -> None:
        """Publish on a schedule."""
        settings = self.node.settings
        schedule.at_rate('publish_rate', settings.publish_rate, self.node.publish)
        if settings.diagnostic_rate > 0.0:
            rate = settings.diagnostic_rate
            schedule.at_rate('diagnostic_rate', rate, self.node.publish_diagnostics)

    def _to_message(self, told: FullVelocity) -> Any:
        settings = self.node.settings
        now = to_stamp(self.robot.world.time) if settings.stamped else None
        return stamped(to_twist(*told), now, settings.base_frame_id)


class JointsFace(ControllerFace):
    """A controller of joints on ROS: keys for its states, too, and its state."""

    needs_clock = False

    def __init__(self, robot: Any) -> None:
        super().__init__(robot)
        keys = LoopbackSubscription(
            self.node, String, 'keys', lambda key: robot.press_state(key.data), EVENTS
        )
        self.key_inputs.insert(0, keys)
        self._state = self.node.create_publisher(String, 'state', LATCHED)
        self._told = ''

    def schedule(self, schedule: Any) -> None:
        """Publish the state when it has changed."""
        schedule.every(STATE_PERIOD, self._publish)

    def _publish(self) -> None:
        if self.robot.state != self._told:
            self._told = self.robot.state
            self._state.publish(String(data=self._told))
