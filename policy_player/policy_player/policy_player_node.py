# SPDX-License-Identifier: Apache-2.0
"""A network on ROS: readings, keys and cmd_vel in, joint commands out."""

from functools import partial
import sys

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import load_robot
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from wasd_core.feed import Feeds
from wasd_core.messages import to_imu_reading, to_joint_commands, to_joint_states, to_seconds
from wasd_core.paired import Answer, LONGEST_GAP, Paired, PairedReadings
from wasd_core.robot_io import JointCommand, JointStates, Reading
from wasd_core.ros_parameters import declare_parameters
from wasd_core.services import offer
from wasd_core.timing import is_press
from wasd_core.topics import (
    AbsenceWatch,
    EVENTS,
    LATCHED,
    RELIABLE,
    SENSOR_DATA,
    VelocitySubscription,
)

from policy_player.joint_controller import JointController, State, STATE_KEYS
from policy_player.loading import load_policy
from policy_player.parameters import policy_player, PolicyNodeParameters
from policy_player.stands import stand_of


class PolicyPlayerNode(Node):
    """
    The face of a `JointController`, by its parameters with a network.

    It steps at each `joint_states` with the `imu/data` of the same stamp and publishes
    `joint_commands`, which the simulator applies at every physics step.
    """

    def __init__(self, *, parameter_overrides: list[Parameter] | None = None) -> None:
        """
        Load the robot and the network that the parameters name.

        Raises:
            UserError: what is wrong with either, in one line.
        """
        super().__init__('policy_player', parameter_overrides=parameter_overrides or [])
        settings = declare_parameters(self, PolicyNodeParameters)
        loaded = load_robot(settings.description)
        player = load_policy(settings.policy or None, settings.policy_config or None, loaded.robot)
        joints = [joint.name for joint in loaded.robot.movable_joints if not joint.mimics]
        self.controller = JointController(joints, stand_of(loaded, joints, player), player)
        self._feeds = Feeds((), 0.0, '')
        if player is not None:
            topics = 'joint_states', 'imu/data'
            self._feeds = Feeds(topics, 1.0 / player.spec.period, "the network's rate")
        self._readings = PairedReadings(
            joints, self._feeds, self._step, self.controller.reset, self._warn
        )
        self._commands = self.create_publisher(JointTrajectory, 'joint_commands', RELIABLE)
        self._state = self.create_publisher(String, 'state', LATCHED)
        self._told = ''
        self._absence = AbsenceWatch(self, self._on_return)
        self.create_subscription(String, 'keys', self._on_key, EVENTS)
        self._cmd_vel = VelocitySubscription(self, self._on_velocity, self._absence.is_stale)
        self.create_subscription(Imu, 'imu/data', self._on_imu, SENSOR_DATA)
        self.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_DATA)
        offer(self, '~/e_stop', self._on_e_stop)

    def close(self) -> None:
        """Leave the joints limp (the simulator's own watchdog brakes them, too)."""
        self.controller.let_go()

    def _on_imu(self, message: Imu) -> None:
        self._readings.take_imu(to_seconds(message.header.stamp), to_imu_reading(message))

    def _on_joints(self, message: JointState) -> None:
        if gap := self._cmd_vel.step():
            self._on_return(gap)
        now, answer = to_seconds(message.header.stamp), partial(self._answer, message.header.stamp)
        self._readings.take_joints(now, tuple(message.name), to_joint_states(message), answer)

    def _step(self, found: Paired, answer: Answer) -> None:
        if found.gap > LONGEST_GAP:
            self.controller.let_go(f'no joint_states for {found.gap:.1f} s: motors damp')
        self._judge_feeds(found.gap)
        order = [found.names.index(name) for name in self.controller.joints]
        joints = JointStates(*(part[order] for part in found.joints))
        answer(self.controller.step(Reading(joints, found.imu), found.gap))

    def _judge_feeds(self, gap: float) -> None:
        """Let the network walk only while every reading comes often enough."""
        before, feeds = self.controller.hindrance, self._feeds
        feeds.judge(gap, rests=self.controller.state is not State.POLICY)
        self.controller.hindrance = feeds.hindrance
        if feeds.hindrance and not before:
            self.get_logger().warning(feeds.hindrance)

    def _answer(self, stamp: Time, command: JointCommand) -> None:
        """Publish the command for joints of this stamp, and the state."""
        self._absence.beat()
        self._commands.publish(to_joint_commands(self.controller.joints, command, stamp))
        if remark := self.controller.take_remark():
            self._warn(remark)
        if self.controller.state != self._told:
            self._told = self.controller.state.value
            self._state.publish(String(data=self._told))

    def _on_key(self, message: String) -> None:
        key = message.data
        if is_press(key) and key in STATE_KEYS and (said := self.controller.press(key)):
            self._warn(said)

    def _on_velocity(self, velocity: tuple[float, float, float], age: float) -> bool:
        if refused := self.controller.command(velocity):
            self._warn(refused)
        return True

    def _on_e_stop(self) -> tuple[bool, str]:
        self.controller.let_go('emergency stop: motors damp')
        return True, 'passive; press 2 to stand again'

    def _on_return(self, gap: float) -> None:
        """Begin without a velocity after this process, or time, stood still: it is too old."""
        self.controller.command((0.0, 0.0, 0.0))
        if any(self.controller.velocity):
            self._warn(f'was paused for {gap:.1f} s: waiting for a new cmd_vel')

    def _warn(self, text: str) -> None:
        self.get_logger().warning(text, throttle_duration_sec=5.0)


if __name__ == '__main__':
    sys.exit(policy_player())
