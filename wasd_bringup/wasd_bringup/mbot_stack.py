# SPDX-License-Identifier: Apache-2.0
"""mbot's nodes in one process: keys, velocity commands, drive controller, in lock-step."""

import time
from typing import Any

from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.geometry import DiffDriveGeometry
from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from mujoco_sim.simulation import Schedule
from mujoco_sim.simulation import TickStatistics
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.world import place_robot
from mujoco_sim.world import PlanarPose
from mujoco_sim.world import World
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import Description
from std_msgs.msg import String
from teleop_keyboard.dashboard import driving_keys
from teleop_keyboard.dashboard import HELP_KEY
from teleop_keyboard.dashboard import is_press
from teleop_keyboard.dashboard import KeyHints
from teleop_keyboard.dashboard import Status
from teleop_keyboard.key_names import STOP_KEY
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from wasd_core.errors import UserError
from wasd_core.robot_io import JointCommand
from wasd_core.timing import Notice
from wasd_core.topics import RELIABLE

from wasd_bringup.options import drive_mode
from wasd_bringup.options import RunOptions
from wasd_bringup.report import Sample

WASD_ADVICE = 'or start with --preset wasd'


class MbotStack:
    """
    What drives mbot: `press` takes keys, `drive` takes velocities; `schedule` has them stepped.

    Raises:
        UserError: the robot's wheels have no motors.
    """

    estimator = 'wheels'
    has_states = False
    stop_key = STOP_KEY
    camera = CameraView(distance=1.6, azimuth=130.0, elevation=-25.0)

    def __init__(self, loaded: Description, world: World, options: RunOptions) -> None:
        self._driver = DiffDriveControllerNode(
            loaded.robot,
            lock_step=True,
            namespace=options.namespace,
            parameter_overrides=[*_overrides(options), *_frames(loaded, world)],
        )
        geometry = self._driver.controller.geometry
        wheels = (geometry.left_joint, geometry.right_joint)
        world.is_kinematic = self._driver.is_fake
        missing = [name for name in wheels if name not in world.motor_names]
        if missing and not self._driver.is_fake:
            raise UserError(
                f'{loaded.robot.name}: no motor on {", ".join(missing)}: '
                'give the joint a <limit effort="..."/>'
            )
        self._world = world
        self._wheels = wheels
        self._motors = [world.motor_names.index(name) for name in wheels if not missing]
        self._joints = [world.joint_names.index(name) for name in wheels]
        self._command = np.zeros((len(JointCommand._fields), len(world.motor_names)))
        self._wheel_links = [loaded.robot.joints[name].child for name in wheels]
        self._teleop = KeysToTwistNode(
            lock_step=True,
            namespace=options.namespace,
            parameter_overrides=[
                Parameter('preset', value=options.preset),
                Parameter('layout', value=options.layout),
            ],
        )
        self._teleop.receivers.append(self._driver.cmd_vel.put)
        # A participant knows one type per topic: that of the controller's subscription.
        self._is_stamped = self._driver.settings.stamped == 'true'
        kind = TwistStamped if self._is_stamped else Twist
        self._twists = self._teleop.create_publisher(kind, 'cmd_vel', RELIABLE)
        self.nodes: list[Node] = [self._driver, self._teleop]
        self._other_presets = '' if options.namespace or options.preset != 'mbot' else WASD_ADVICE
        self._hints = KeyHints(
            self._teleop.logic, HELP_KEY, advice=self._other_presets, axes=('x', 'yaw')
        )
        self.notice = Notice()
        self.ticks = TickStatistics(self.period)

    @property
    def period(self) -> float:
        """The controller's period [s]."""
        return 1.0 / self._driver.update_rate

    @property
    def geometry(self) -> DiffDriveGeometry:
        """The wheels as the controller believes them to be."""
        return self._driver.controller.geometry

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""
        return tuple(self._teleop.logic.keymap.help_lines)

    @property
    def first_keys(self) -> str:
        """The keys to press first."""
        keys = driving_keys(self._teleop.logic.keymap)
        advice = f', {self._other_presets}' if self._other_presets else ''
        return f'drive with {keys} (forward, back, left, right){advice}'

    @property
    def state(self) -> str:
        """The drive controller's state."""
        return self._driver.controller.state

    def press(self, message: String) -> None:
        """Take a key."""
        self._teleop.keys.put(message)
        if is_press(message.data):
            self.notice.say(self._hints.press(message.data))

    def takes(self, key: str) -> bool:
        """Return whether a key means something of its own to this robot."""
        return key in self._teleop.logic.keymap.keys

    def schedule(self, schedule: Schedule) -> None:
        """Have the nodes stepped on simulated time: ramps, then wheels, then odometry."""
        period = 1.0 / self._teleop.logic.rate
        schedule.every(period, lambda: self._teleop.step(period))
        schedule.every(self.period, self._control)
        rate = self._driver.settings.publish_rate
        schedule.at_rate('publish_rate', rate, self._driver.publish)
        if self._driver.settings.diagnostic_rate > 0.0:
            rate = self._driver.settings.diagnostic_rate
            schedule.at_rate('diagnostic_rate', rate, self._driver.publish_diagnostics)

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion that keys have set going."""
        return self._teleop.logic.stops(key)

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""
        return self._teleop.logic.latches(key)

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Command a velocity [m/s], [m/s], [rad/s] through cmd_vel."""
        message: Any = TwistStamped() if self._is_stamped else Twist()
        twist = message
        if self._is_stamped:
            message.header.stamp = self._driver.get_clock().now().to_msg()
            message.header.frame_id = self._driver.settings.base_frame_id
            twist = message.twist
        twist.linear.x, twist.linear.y, twist.angular.z = velocity
        self._driver.cmd_vel.put(message)
        self._twists.publish(message)

    def reset(self) -> None:
        """Forget the past: commands, ramps, odometry."""
        self._teleop.logic.reset()
        self._driver.unit.reset()
        self.notice.say(None)

    def odometry(self) -> Odometry:
        """Return odom as it is published in this instant."""
        return self._driver.odometry()

    def sample(self) -> Sample:
        """Return this instant for the report."""
        controller = self._driver.controller
        pose = controller.odometry_state
        # Without physics there is nothing that presses.
        links = self._wheel_links
        forces = self._world.contact_forces(links) * (not self._driver.is_fake)
        return Sample(
            controller.state,
            (controller.target.linear, 0.0, controller.target.angular),
            (pose.x, pose.y, pose.yaw),
            (forces > 0.0).astype(int).tolist(),
        )

    def status(self) -> Status:
        """Return what a driver wants to see."""
        logic, controller = self._teleop.logic, self._driver.controller
        linear, angular = controller.velocity
        facts = (
            f'now {linear:+.2f} m/s {angular:+.2f} rad/s',
            f'full {logic.speed:.2f} m/s {logic.turn:.2f} rad/s',
        )
        return Status(controller.state, facts, self.notice.text)

    def halt(self) -> None:
        """Command standstill, now and in the last word on cmd_vel, until the next key."""
        self._teleop.close()

    def close(self) -> None:
        """Stop the robot: the last cmd_vel is zero."""
        self._teleop.close()
        self._driver.close()

    def _control(self) -> None:
        started = time.perf_counter()
        if self._driver.is_fake:
            self._drive_fake()
        else:
            left, right = self._world.joints().position[self._joints].tolist()
            # Other motors than the wheels' stay limp: their columns are zero.
            self._command[:, self._motors] = self._driver.control(left, right, self.period)
            self._world.apply(JointCommand(*self._command))
        self.ticks.add(time.perf_counter() - started)

    def _drive_fake(self) -> None:
        """Let the robot of arithmetic drive, and show it in the world."""
        unit = self._driver.unit
        unit.step_fake(self.period)
        x, y, yaw, linear, angular, lateral = unit.fake.pose
        states = zip(unit.fake.angles, unit.fake.speeds, strict=True)
        pose = PlanarPose(x, y, yaw, linear, lateral, angular)
        place_robot(self._world, pose, dict(zip(self._wheels, states, strict=True)))


def _overrides(options: RunOptions) -> list[Parameter]:
    """Return what the command line says of the drive."""
    given = {'controller': options.controller and str(options.controller)}
    given['mode'] = drive_mode(options)
    return [Parameter(name, value=value) for name, value in given.items() if value is not None]


def _frames(loaded: Description, world: World) -> list[Parameter]:
    """Return the frames of one of several robots; alone, a controller file may name them."""
    if not world.prefix:
        return []
    return [
        Parameter('odom_frame_id', value=f'{world.prefix}odom'),
        Parameter('base_frame_id', value=world.prefix + loaded.robot.root),
    ]
