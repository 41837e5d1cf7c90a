# SPDX-License-Identifier: Apache-2.0
"""The leg controller on ROS: keys and cmd_vel in, odom and joint commands out."""

from collections.abc import Iterable
import math
import sys
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import Description, load_robot
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import to_base_state, to_joint_commands, to_reading, to_seconds
from wasd_core.node import run_node
from wasd_core.parameter_file import NodeKind, read_parameters
from wasd_core.robot_io import BaseState, JointCommand, Reading
from wasd_core.ros_parameters import declare_parameters
from wasd_core.signals import stop_requested
from wasd_core.streams import visible
from wasd_core.timing import Beat, NO_PRESS, Notice
from wasd_core.topics import (
    AbsenceWatch,
    EVENTS,
    has_listener,
    LATCHED,
    LoopbackSubscription,
    PublisherWatch,
    RELIABLE,
    SENSOR_DATA,
    TfBroadcaster,
)

from quadruped_sim.compilation import compile_once, warm_up
from quadruped_sim.feed import Feed
from quadruped_sim.keys import StickValues
from quadruped_sim.leg_controller import LegController
from quadruped_sim.parameters import leg_controller, LegNodeParameters
from quadruped_sim.robot_model import JointMap, RobotModel
from quadruped_sim.robot_state import LegOdometry

# Longest step of gait and estimate between two readings [s]; a request is as old as it is.
MAXIMUM_STEP = 0.02
# After so long without a reading the motors have braked and the robot has sunk [s].
LONGEST_GAP = 0.3
# Who rests is told so long after readings have become slow [s]:
# a simulator waits for nobody until it is first answered, and states may be lost till then.
SLOW_AT_REST = 1.0
# One that moves is stopped after this [s]: what a busy machine loses for a moment does no harm.
SLOW_IN_MOTION = 0.05
KIND = NodeKind(leg_controller.name, 'leg controller')


class Frames(NamedTuple):
    """Names of the frame in which odometry is given, and of the robot's that it follows."""

    odom: str
    base: str


class LegControllerNode(Node):
    """
    Walks a quadruped from keys and cmd_vel.

    Alone, it steps at each `joint_states` with the `imu/data` of the same stamp and publishes
    `joint_commands`. In lock-step the simulation loop calls `control` and `publish_odometry`, and
    `keys.put` and `cmd_vel.put` hand over what comes from the same process.
    """

    def __init__(
        self,
        description: Description | None = None,
        *,
        lock_step: bool = False,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        """
        Take a robot, or load the description that the parameter names.

        Raises:
            UserError: what is wrong with the parameters or the robot, in one line.
            Stopped: a signal came while the controller was being compiled.
        """
        super().__init__(
            'leg_controller', namespace=namespace, parameter_overrides=parameter_overrides or []
        )
        self.settings = declare_parameters(
            self, LegNodeParameters, self._on_change, _parameters_of_file(self)
        )
        description = description or load_robot(self.settings.description)
        # Before anything else calls a compiled function; loading is no part of the first tick.
        model = compile_once(
            lambda: _warm_model(description), self.get_logger().info, stop_requested
        )
        self.controller = LegController(model, self.settings, self.settings.estimator)
        for note in self.controller.notes:
            self.get_logger().warning(note)
        # What is said to the driver. In lock-step whoever shows it lets its time pass.
        self.notice = Notice()
        self._refused: str | None = None
        self.quadruped = model.quadruped
        self._names: tuple[tuple[str, ...], tuple[str, ...]] = (), ()
        root = description.robot.base
        self._frames = Frames(self.settings.odom_frame, self.settings.base_frame or root)
        self.keys = LoopbackSubscription(self, String, 'keys', self._on_key, EVENTS)
        self._is_alone = not lock_step
        self._absence = AbsenceWatch(self, self._on_return)
        self.cmd_vel = LoopbackSubscription(
            self, Twist, 'cmd_vel', self._on_twist, is_stale=self._absence.is_stale
        )
        self._odometry = self.create_publisher(Odometry, 'odom', RELIABLE)
        self._state = self.create_publisher(String, 'state', LATCHED)
        self._published_state = ''
        self._tf = TfBroadcaster(self)
        self.create_service(Trigger, '~/e_stop', self._on_e_stop)
        if not lock_step:
            self._listen()

    def control(
        self,
        reading: Reading,
        joint_names: tuple[str, ...],
        motor_names: tuple[str, ...],
        dt: float,
        truth: BaseState | None = None,
    ) -> JointCommand:
        """Return the motors' command for a reading `dt` [s] after the one before."""
        self._absence.beat()
        if (joint_names, motor_names) != self._names:
            self._names = joint_names, motor_names
            self._joints = JointMap(self.quadruped, joint_names, motor_names)
        command = self.controller.step(self._joints.reading(reading), dt, truth)
        return self._joints.command(command)

    def publish_odometry(self, stamp: Time | None = None) -> None:
        """Publish odom and /tf with one stamp, or now; the state when it has changed."""
        stamp = stamp or self.get_clock().now().to_msg()
        message = self.odometry(stamp) if has_listener(self._odometry) else None
        if message is not None:
            self._odometry.publish(message)
        state = self.controller.odometry if self._tf.available else None
        if state is not None:
            self._tf.send([to_transform(state, stamp, self._frames)])
        if self.controller.state != self._published_state:
            self._published_state = self.controller.state
            self._state.publish(String(data=self._published_state))
            event = self.controller.event
            if event is not None and self._published_state == 'passive':
                legs = self.controller
                self._say(legs.words.to_event(event, legs.is_fallen, legs.obstacle))

    def odometry(self, stamp: Time | None = None) -> Odometry | None:
        """Return odom as `publish_odometry` publishes it, of now; None before there is any."""
        state = self.controller.odometry
        if state is None:
            return None
        return to_odometry(state, stamp or self.get_clock().now().to_msg(), self._frames)

    def reset(self) -> None:
        """Begin anew, passive."""
        self.controller.reset()
        self._tell_gait()
        self.notice.say(None)

    def close(self) -> None:
        """Leave the legs passive (the simulator's own watchdog brakes them, too)."""
        self.controller.e_stop()

    def _say(self, text: str | None) -> None:
        if self.notice.say(text) and text:
            self.get_logger().warning(visible(text))

    def _on_change(self, settings: LegNodeParameters) -> None:
        """Go on with other parameters, from the next tick."""
        self.settings = settings
        self.controller.tune(settings)

    def _on_key(self, message: String) -> None:
        if message.data.startswith(NO_PRESS):
            return  # the sticks go by presses alone
        self._say(self.controller.press(message.data))
        self._tell_gait()

    def _tell_gait(self) -> None:
        """Have the parameter say which gait a key, or the reset, has chosen."""
        if self.controller.gait != self.settings.gait.name:
            self.set_parameters([Parameter('gait', value=self.controller.gait)])

    def _on_twist(self, message: Twist) -> None:
        refusal = self.controller.set_velocity(
            message.linear.x, message.linear.y, message.angular.z
        )
        # Once: commands come twenty times a second, and keys are to have their say, too.
        if refusal is not None and refusal != self._refused:
            self._say(refusal)
        self._refused = refusal

    def _on_return(self, gap: float) -> None:
        """Begin without a velocity after this process stood still: nobody knows who wants it."""
        # In lock-step robot and process stood still together: its time has not gone on.
        if not self._is_alone:
            return
        asked = self.controller.command_filter
        was_driven = self.controller.state == 'move base' and not asked.is_silent
        asked.forget_request()
        if was_driven:
            self.get_logger().warning(f'stood still for {gap:.1f} s: waiting for a new cmd_vel')

    def _on_e_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.controller.e_stop()
        response.success = True
        response.message = 'passive; press 2 to stand again'
        return response

    def _listen(self) -> None:
        """Take readings from topics and command the motors by one."""
        self._commands = self.create_publisher(JointTrajectory, 'joint_commands', RELIABLE)
        self._imu: Imu | None = None
        self._truth: BaseState | None = None
        self._truth_at = -math.inf
        self._waiting: JointState | None = None
        self._last: float | None = None
        topics = ['joint_states', 'imu/data']
        topics += ['ground_truth/odom'] if self.settings.estimator == 'truth' else []
        self._slow_for = 0.0  # readings have come too slowly for so long [s]
        self._feeds = {topic: Feed(self.settings.update_rate) for topic in topics}
        self._needed = set(self.quadruped.joint_names)
        self._beat = Beat()
        self._keyboard = PublisherWatch(self, 'keys', self._on_lost_keyboard)
        self.create_subscription(Imu, 'imu/data', self._on_imu, SENSOR_DATA)
        self.create_subscription(JointState, 'joint_states', self._on_joint_states, SENSOR_DATA)
        if self.settings.estimator == 'truth':
            self.create_subscription(Odometry, 'ground_truth/odom', self._on_truth, SENSOR_DATA)

    def _on_lost_keyboard(self) -> None:
        """Centre the sticks: they stay where keys have put them, the keyboard does not."""
        if self.controller.sticks.values != StickValues():
            self.controller.sticks.zero()
            self._warn('nobody publishes keys any more: sticks centred')

    def _on_imu(self, message: Imu) -> None:
        self._imu = message
        self._feeds['imu/data'].take(to_seconds(message.header.stamp))
        self._answer_when_complete()

    def _on_truth(self, message: Odometry) -> None:
        self._truth = to_base_state(message)
        self._truth_at = to_seconds(message.header.stamp)
        self._feeds['ground_truth/odom'].take(self._truth_at)
        self._answer_when_complete()

    def _on_joint_states(self, message: JointState) -> None:
        """Wait for what belongs to it: topics overtake each other, on a busy machine by far."""
        if not self._is_complete(message):
            return
        late, self._waiting = self._waiting, message
        if late is not None:
            self._answer(late)  # the rest of it has been lost, or comes less often
        self._answer_when_complete()

    def _answer_when_complete(self) -> None:
        """Answer the joints that wait once the other messages of their stamp have come."""
        if self._waiting is None or self._imu is None:
            return
        now = to_seconds(self._waiting.header.stamp)
        has_truth = self.settings.estimator != 'truth' or self._truth_at >= now
        if has_truth and to_seconds(self._imu.header.stamp) >= now:
            message, self._waiting = self._waiting, None
            self._answer(message)

    def _answer(self, message: JointState) -> None:
        """Step with joints and the latest of the other messages; publish what comes of it."""
        if self._imu is None:
            return
        stamp = message.header.stamp
        now = to_seconds(stamp)
        previous, self._last = self._last, now
        self._feeds['joint_states'].take(now)
        if previous is None or now == previous:
            return
        if now < previous:
            self.reset()
            self._warn('time went back, as of a simulator that was started again: passive')
            return
        if abs(now - to_seconds(self._imu.header.stamp)) > MAXIMUM_STEP:
            self._warn('imu/data is silent: no commands')
            return
        self._judge_feeds(now - previous)
        names, motors = tuple(message.name), self.quadruped.joint_names
        self.notice.step(now - previous)
        dt = min(now - previous, MAXIMUM_STEP)
        self.controller.command_filter.pass_time(now - previous - dt)
        reading = to_reading(message, self._imu)
        command = self.control(reading, names, motors, dt, self._truth)
        self._commands.publish(to_joint_commands(motors, command, stamp))
        if self._beat.is_due(now, self.settings.publish_rate):
            # Of the reading: this node's own clock need not be the simulator's.
            self.publish_odometry(stamp)

    def _judge_feeds(self, gap: float) -> None:
        """Move only while every reading comes often enough; the last one came `gap` [s] ago."""
        legs = self.controller
        if gap > LONGEST_GAP:
            legs.e_stop(f'no joint_states for {gap:.1f} s')
        slow = [topic for topic, feed in self._feeds.items() if feed.is_slow]
        self._slow_for = self._slow_for + gap if slow else 0.0
        if legs.hindrance and not slow:
            legs.hindrance = ''
            self.get_logger().info('readings come often enough again: it may move')
            return
        patience = SLOW_AT_REST if legs.rests else SLOW_IN_MOTION
        if not legs.hindrance and self._slow_for > patience:
            topic, wanted = slow[0], self.settings.update_rate
            legs.hindrance = (
                f'{topic} comes at {self._feeds[topic].rate:.0f} Hz, wanted {wanted:g} '
                f'(update_rate): it does not move; start the simulator with '
                f'state_rate:={wanted:.1f}'
            )
            self._say(legs.hindrance)

    def _is_complete(self, message: JointState) -> bool:
        """Whether a message tells position, velocity and effort of every joint of ours."""
        lengths = {len(message.position), len(message.velocity), len(message.effort)}
        if self._needed <= set(message.name) and lengths == {len(message.name)}:
            return True
        self._warn('joint_states lacks joints, velocities or efforts: ignored')
        return False

    def _warn(self, text: str) -> None:
        self.get_logger().warning(text, throttle_duration_sec=5.0)


def to_odometry(state: LegOdometry, stamp: Time, frames: Frames) -> Odometry:
    """Return nav_msgs/Odometry: pose in the odom frame, twist in the base frame."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.pose.pose.position, state.position)
    _set_wxyz(message.pose.pose.orientation, state.orientation)
    _set_xyz(message.twist.twist.linear, state.linear_velocity)
    _set_xyz(message.twist.twist.angular, state.angular_velocity)
    message.pose.covariance[:] = state.pose_covariance.flatten()
    message.twist.covariance[:] = state.twist_covariance.flatten()
    return message


def to_transform(state: LegOdometry, stamp: Time, frames: Frames) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.transform.translation, state.position)
    _set_wxyz(message.transform.rotation, state.orientation)
    return message


def _set_xyz(target: Any, values: Iterable[float]) -> None:
    target.x, target.y, target.z = map(float, values)


def _set_wxyz(target: Any, values: Iterable[float]) -> None:
    target.w, target.x, target.y, target.z = map(float, values)


def _warm_model(description: Description) -> RobotModel:
    """Return the model of a robot, with all loaded that its controller compiles."""
    model = RobotModel(description)
    warm_up(model)
    return model


def _parameters_of_file(node: Node) -> LegNodeParameters:
    """
    Return the defaults with the values of the file that `controller` names, if it names one.

    Raises:
        InvalidParameter: what is wrong with the file, with its line.
    """
    given = node._parameter_overrides.get('controller')
    path = '' if given is None else given.value
    if not isinstance(path, str) or not path:
        return LegNodeParameters()
    return LegNodeParameters.from_mapping(read_parameters(path, LegNodeParameters, KIND))


def main(args: list[str] | None = None) -> int:
    """Run the leg controller as a process of its own."""
    return run_node(LegControllerNode, args, program=leg_controller)


if __name__ == '__main__':
    sys.exit(main())
