# SPDX-License-Identifier: Apache-2.0
"""The leg controller on ROS: keys and cmd_vel in, odom and joint commands out."""

from collections.abc import Callable
from functools import partial
import sys

from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from policy_player.loading import load_policy
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import load_robot
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import (
    to_base_state,
    to_base_transform,
    to_imu_reading,
    to_joint_commands,
    to_joint_states,
    to_odometry,
    to_seconds,
)
from wasd_core.robot_io import JointCommand
from wasd_core.ros_parameters import declare_parameters
from wasd_core.services import offer
from wasd_core.streams import visible
from wasd_core.timing import Beat
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
    VelocitySubscription,
)

from quadruped_sim.elevation import Elevation
from quadruped_sim.elevation_publisher import CloudInput, ElevationPublisher
from quadruped_sim.legs import Legs
from quadruped_sim.parameters import leg_controller, LegNodeParameters
from quadruped_sim.readings import Readings


class LegControllerNode(Node):
    """
    The face of a quadruped's legs: keys, cmd_vel and parameters in, odom, /tf and state out.

    The owner of given legs steps them, calls `publish`, and may put another receiver in place of
    `cmd_vel.on_velocity`. Alone, it makes legs by its parameters,
    steps them at each `joint_states` with the `imu/data` of the same stamp, and publishes
    `joint_commands`.
    """

    def __init__(
        self,
        legs: Legs | None = None,
        *,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        """
        Configure legs by the parameters, or load the description that these name.

        Raises:
            UserError: what is wrong with the parameters or the robot, in one line.
            Stopped: a signal came while the controller was being compiled.
        """
        super().__init__(
            'leg_controller', namespace=namespace, parameter_overrides=parameter_overrides or []
        )
        settings = declare_parameters(
            self, LegNodeParameters, self._on_change, _parameters_of_file(self)
        )
        description = None if legs else load_robot(settings.description)
        if description is not None:
            walker = load_policy(
                settings.policy or None, settings.policy_config or None, description.robot
            )
            legs = Legs(description, inform=self.get_logger().info, walker=walker)
        assert legs is not None
        self.legs = legs
        self.legs.configure(settings)
        for note in self.legs.controller.notes:
            self.get_logger().warning(note)
        self.legs.on_said = lambda text: self.get_logger().warning(visible(text))
        self._told = settings.gait.name, settings.eyes
        self.frames = settings.odom_frame, settings.base_frame or self.legs.base_frame
        self.keys = LoopbackSubscription(self, String, 'keys', self._on_key, EVENTS)
        self._absence = AbsenceWatch(self, self._on_return)
        self.cmd_vel = VelocitySubscription(self, self._on_velocity, self._absence.is_stale)
        self._odometry = self.create_publisher(Odometry, 'odom', RELIABLE)
        self._state = self.create_publisher(String, 'state', LATCHED)
        self._published_state = ''
        self._tf = TfBroadcaster(self)
        self.heights = ElevationPublisher(self)
        self._seen: Elevation | None = None
        self.on_press: Callable[[str], object] = self.legs.press
        # It returns what its caller is told, where that is something else than usual.
        self.on_e_stop: Callable[[], str | None] = self.legs.e_stop
        offer(self, '~/e_stop', self._on_e_stop)
        self.readings: Readings | None = None
        if description is not None:
            self._clouds = CloudInput(self, description.robot, self._wants_map, self._on_map)
            self.readings = self._listen()

    def publish(self, stamp: Time) -> None:
        """Publish odom and /tf with one stamp; state and gait when they have changed."""
        self._absence.beat()
        self._tell_keys()
        message = self.odometry(stamp) if has_listener(self._odometry) else None
        if message is not None:
            self._odometry.publish(message)
        state = self.legs.odometry if self._tf.available else None
        if state is not None:
            self._tf.send([to_base_transform(state, *self.frames, stamp)])
        self.heights.look()
        odometry = self.legs.odometry if self.heights.is_wanted else None
        if self._seen is not None and odometry is not None:
            self.heights.publish_scan(self._seen, odometry, self.frames[0], stamp)
        if self.legs.state != self._published_state:
            self._published_state = self.legs.state
            self._state.publish(String(data=self._published_state))

    def tell_heights(self, elevation: Elevation, stamp: Time) -> None:
        """Publish a map that a cloud of this stamp has changed; `publish` scans it from now on."""
        self._seen = elevation
        self.heights.publish_map(elevation, self.frames[0], stamp)

    def odometry(self, stamp: Time) -> Odometry | None:
        """Return odom as `publish` publishes it, of now; None before there is any."""
        state = self.legs.odometry
        if state is None:
            return None
        return to_odometry(state, *self.frames, stamp)

    def close(self) -> None:
        """Leave the legs passive (the simulator's own watchdog brakes them, too)."""
        self.legs.controller.e_stop()

    def _on_change(self, settings: LegNodeParameters) -> None:
        self._told = settings.gait.name, settings.eyes
        self.legs.tune(settings)

    def _on_key(self, message: String) -> None:
        self.on_press(message.data)
        self._tell_keys()

    def _tell_keys(self) -> None:
        """Set the parameters `gait` and `eyes` to what a key, or a reset, has chosen."""
        chosen = self.legs.settings.gait.name, self.legs.settings.eyes
        if chosen == self._told:
            return
        told = dict(zip(('gait', 'eyes'), zip(chosen, self._told, strict=True), strict=True))
        changed = [Parameter(name, value=now) for name, (now, was) in told.items() if now != was]
        self.set_parameters(changed)

    def _wants_map(self) -> bool:
        return self.heights.is_wanted or self.legs.wants_map

    def _on_map(self, elevation: Elevation, stamp: Time) -> None:
        self.legs.see(elevation)
        self.tell_heights(elevation, stamp)

    def _on_velocity(self, velocity: tuple[float, float, float], age: float) -> bool:
        self.legs.command(*velocity)
        return True

    def _on_return(self, gap: float) -> None:
        """Begin without a velocity after this process, or time, stood still: it is too old."""
        # Where somebody else steps, robot and process stood still together.
        if self.readings is not None and self.legs.forget_velocity():
            self.get_logger().warning(f'was paused for {gap:.1f} s: waiting for a new cmd_vel')

    def _on_e_stop(self) -> tuple[bool, str]:
        return True, self.on_e_stop() or 'passive; press 2 to stand again'

    def _listen(self) -> Readings:
        """Take readings from topics and command the motors by one."""
        readings = Readings(self.legs, self._warn, self.get_logger().info)
        self._commands = self.create_publisher(JointTrajectory, 'joint_commands', RELIABLE)
        self._beat = Beat()
        self._keyboard = PublisherWatch(self, 'keys', self._on_lost_keyboard)

        def on_imu(message: Imu) -> None:
            readings.take_imu(to_seconds(message.header.stamp), to_imu_reading(message))

        def on_truth(message: Odometry) -> None:
            readings.take_truth(to_seconds(message.header.stamp), to_base_state(message))

        def on_joint_states(message: JointState) -> None:
            if gap := self.cmd_vel.step():
                self._on_return(gap)
            stamp, names = message.header.stamp, tuple(message.name)
            answer = partial(self._answer, stamp)
            readings.take_joints(to_seconds(stamp), names, to_joint_states(message), answer)

        self.create_subscription(Imu, 'imu/data', on_imu, SENSOR_DATA)
        self.create_subscription(JointState, 'joint_states', on_joint_states, SENSOR_DATA)
        if self.legs.settings.estimator == 'truth':
            self.create_subscription(Odometry, 'ground_truth/odom', on_truth, SENSOR_DATA)
        return readings

    def _answer(self, stamp: Time, command: JointCommand) -> None:
        """Publish the command for joints of this stamp."""
        motors = self.legs.model.quadruped.joint_names
        self._commands.publish(to_joint_commands(motors, command, stamp))
        odometry = self.legs.odometry
        if odometry is not None:
            self._clouds.step(to_seconds(stamp), odometry)
        if self._beat.is_due(to_seconds(stamp), self.legs.settings.publish_rate):
            # Of the reading: this node's own clock need not be the simulator's.
            self.publish(stamp)

    def _on_lost_keyboard(self) -> None:
        if self.legs.centre_sticks():
            self._warn('the last publisher of keys is gone: sticks centred')

    def _warn(self, text: str) -> None:
        self.get_logger().warning(text, throttle_duration_sec=5.0)


def _parameters_of_file(node: Node) -> LegNodeParameters:
    """Return the defaults with the values of the file that `controller` names, if it names one."""
    given = node._parameter_overrides.get('controller')
    path = '' if given is None else given.value
    return LegNodeParameters.from_file(path if isinstance(path, str) else '')


if __name__ == '__main__':
    sys.exit(leg_controller())
