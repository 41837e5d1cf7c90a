# SPDX-License-Identifier: Apache-2.0
"""mbot's nodes in one process: keys, velocity commands, drive controller, in lock-step."""

from typing import Any

from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.odometry import DiffDriveGeometry
from geometry_msgs.msg import Twist, TwistStamped
from mujoco_sim.simulation import Schedule
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.world import place_robot, PlanarPose, World
import numpy as np
from rclpy.parameter import Parameter
from robot_description.description import Description
from std_msgs.msg import String
from teleop_keyboard.dashboard import Axis, driving_keys, HELP_KEY, KeyHints, Status
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry, JointCommand
from wasd_core.timing import is_press, Notice

from diff_drive_sim import MODES as DRIVE_MODES
from wasd_bringup.options import RunOptions
from wasd_bringup.report import Sample
from wasd_bringup.robots import MBOT, MODES
from wasd_bringup.stack import ControlStack, Velocity

WASD_ADVICE = 'or start with --preset wasd'


class MbotStack(ControlStack):
    """
    What drives mbot: `press` takes keys, `drive` takes velocities; `schedule` has them stepped.

    Raises:
        UserError: the robot's wheels have no motors.
    """

    camera = CameraView(distance=1.6, azimuth=130.0, elevation=-25.0)

    def __init__(self, loaded: Description, world: World, options: RunOptions) -> None:
        self._unit = DiffDrive(loaded.robot)
        self._driver = _make_driver(self._unit, loaded, world, options)
        # A participant knows one type per topic: that of the controller's subscription.
        self._is_stamped = self._driver.settings.stamped == 'true'
        super().__init__(world, options, self._driver, TwistStamped if self._is_stamped else Twist)
        self.estimator = 'wheels'
        self.start = world.setup.place
        mode = self._driver.settings.mode
        # The usual one by the word that asked for it.
        self.mode = (options.mode or MODES[0]) if mode == DRIVE_MODES[0] else mode
        geometry = self._driver.controller.geometry
        self._wheels = (geometry.left_joint, geometry.right_joint)
        world.is_kinematic = self._unit.is_fake
        missing = [name for name in self._wheels if name not in world.motor_names]
        if missing and not self._unit.is_fake:
            raise UserError(
                f'{loaded.robot.name}: no motor on {", ".join(missing)}: '
                'give the joint a <limit effort="..."/>'
            )
        self._motors = [world.motor_names.index(name) for name in self._wheels if not missing]
        self._places = world.parts.position[list(map(world.joint_names.index, self._wheels))]
        self._command = np.zeros((len(JointCommand._fields), len(world.motor_names)))
        self._wheel_links = [loaded.robot.joints[name].child for name in self._wheels]
        is_usual = options.preset == MBOT.preset
        self._other_presets = WASD_ADVICE if is_usual and not options.namespace else ''
        self._hints = KeyHints(self.logic, HELP_KEY, advice=self._other_presets, axes=('x', 'yaw'))
        self.notice = Notice()

    @property
    def driver(self) -> DiffDriveControllerNode:
        """The node that drives."""
        return self._driver

    @property
    def period(self) -> float:
        """The controller's period [s]."""
        return 1.0 / self._unit.update_rate

    @property
    def drive_limits(self) -> dict[str, float]:
        """How fast a navigator may drive it: no faster than the controller will."""
        settings = self._driver.settings
        linear = settings.linear_limits()
        angular = settings.angular_limits(self.geometry.wheel_separation)
        most = {
            'forward': (0.5, linear.forward),
            'backward': (0.2, linear.backward),
            'yaw': (1.5, angular.forward, angular.backward),
            'forward_acceleration': (0.8, linear.speed_up, linear.slow_down),
            'yaw_acceleration': (3.0, angular.speed_up, angular.slow_down),
        }
        return {name: min(limits) for name, limits in most.items()}

    @property
    def geometry(self) -> DiffDriveGeometry:
        """The wheels as the controller believes them to be."""
        return self._driver.controller.geometry

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""
        return tuple(self.logic.keymap.help_lines)

    @property
    def first_keys(self) -> str:
        """The keys to press first."""
        keys = driving_keys(self.logic.keymap)
        advice = f', {self._other_presets}' if self._other_presets else ''
        return f'drive with {keys} (forward, back, left, right){advice}'

    def press(self, key: str, is_pressed: bool = True) -> None:
        """Take a key."""
        assert self._teleop is not None
        self._teleop.keys.put(String(data=key))
        if is_press(key) and is_pressed:
            self.notice.say(self._hints.press(key))

    def reset(self) -> None:
        """Forget the past: commands, ramps, odometry."""
        super().reset()
        self._unit.reset()
        self.notice.say(None)

    @property
    def base_odometry(self) -> BaseOdometry:
        """Where its wheels say it is."""
        return self._unit.odometry

    def sample(self) -> Sample:
        """Return this instant for the report."""
        controller = self._driver.controller
        pose = controller.odometry_state
        # Without physics there is nothing that presses.
        links = self._wheel_links
        forces = self._world.contact_forces(links) * (not self._unit.is_fake)
        return Sample(
            controller.state,
            (controller.target.linear, 0.0, controller.target.angular),
            (pose.x, pose.y, pose.yaw),
            (forces > 0.0).astype(int).tolist(),
        )

    def status(self) -> Status:
        """Return what a driver wants to see."""
        logic, controller = self.logic, self._driver.controller
        linear, angular = controller.velocity
        facts = (
            f'now {linear:+.2f} m/s {angular:+.2f} rad/s',
            f'full {logic.speed:.2f} m/s {logic.turn:.2f} rad/s',
        )
        wanted, wheels = controller.target, controller.odometry_state
        axes = (
            Axis('forward', 'm/s', wanted.linear, wheels.linear, logic.speed),
            Axis('turn', 'rad/s', wanted.angular, wheels.angular, logic.turn),
        )
        return Status(controller.state, facts, self.notice.text, axes)

    @property
    def logic(self) -> KeysToTwist:
        """What makes keys velocities."""
        assert self._teleop is not None  # whatever the preset: wheels know no states
        return self._teleop.logic

    def _to_twist(self, velocity: Velocity) -> Any:
        twist = super()._to_twist(velocity)
        if not self._is_stamped:
            return twist
        message = TwistStamped(twist=twist)
        message.header.stamp = self._driver.get_clock().now().to_msg()
        message.header.frame_id = self._driver.settings.base_frame_id
        return message

    def _schedule_publishing(self, schedule: Schedule) -> None:
        settings = self._driver.settings
        schedule.at_rate('publish_rate', settings.publish_rate, self._driver.publish)
        if settings.diagnostic_rate > 0.0:
            rate = settings.diagnostic_rate
            schedule.at_rate('diagnostic_rate', rate, self._driver.publish_diagnostics)

    def _control(self) -> None:
        if self._unit.is_fake:
            self._drive_fake()
        else:
            left, right = self._world.data.qpos[self._places].tolist()
            # Other motors than the wheels' stay limp: their columns are zero.
            command = self._unit.control(left, right, self.period)
            for row, part in zip(self._command, command, strict=True):
                row[self._motors] = part
            self._world.apply(JointCommand(*self._command))
            ahead, _, turn = self._world.base().planar_velocity.tolist()
            self._unit.watch(ahead, turn, self.period)

    def _drive_fake(self) -> None:
        """Let the robot of arithmetic drive, and show it in the world."""
        unit = self._unit
        unit.step_fake(self.period)
        x, y, yaw, linear, angular, lateral = unit.fake.pose
        states = zip(*map(unit.flip, (unit.fake.angles, unit.fake.speeds)), strict=True)
        pose = PlanarPose(x, y, yaw, linear, lateral, angular)
        place_robot(self._world, pose, dict(zip(self._wheels, states, strict=True)))


def _make_driver(
    unit: DiffDrive, loaded: Description, world: World, options: RunOptions
) -> DiffDriveControllerNode:
    """Return the face of a robot's drive, with what the command line says of it."""
    given = {'controller': str(options.controller or ''), 'mode': options.drive_mode}
    return DiffDriveControllerNode(
        unit,
        namespace=options.namespace,
        parameter_overrides=[
            *(Parameter(name, value=value) for name, value in given.items() if value),
            *_frames(loaded, world),
        ],
        file=options.drive_file,
    )


def _frames(loaded: Description, world: World) -> list[Parameter]:
    """Return the frames of one of several robots; alone, a controller file may name them."""
    if not world.prefix:
        return []
    return [
        Parameter('odom_frame_id', value=f'{world.prefix}odom'),
        Parameter('base_frame_id', value=world.prefix + loaded.robot.root),
    ]
