# SPDX-License-Identifier: Apache-2.0
"""A robot of a run with two driven wheels: keys and velocities in, wheel speeds out."""

from collections.abc import Callable, Sequence
from typing import Any

from diff_drive_sim.drive import DiffDrive, DiffDriveController
from diff_drive_sim.limits import Velocity as DriveVelocity
from diff_drive_sim.odometry import DiffDriveGeometry
from diff_drive_sim.parameters import DiffDriveParameters
from mujoco_sim.simulation import Simulation
from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.world import place_robot, PlanarPose, World
import numpy as np
from robot_description.description import Description
from teleop_keyboard.dashboard import Axis, driving_keys, HELP_KEY, KeyHints, Status
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry, JointCommand
from wasd_core.timing import is_press, Notice

from diff_drive_sim import MODES as DRIVE_MODES
from wasd_bringup.robots import MBOT, MODES
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.report import Sample
from wasd_bringup.run.robot import Robot, Velocity

WASD_ADVICE = 'or start with --preset wasd'


class Mbot(Robot):
    """
    Two driven wheels with their drive controller; in mode fake they roll by arithmetic.

    Raises:
        UserError: the robot's wheels have no motors.
    """

    camera = CameraView(distance=1.6, azimuth=130.0, elevation=-25.0)
    estimator = 'wheels'
    logic: KeysToTwist  # whatever the preset: wheels know no states

    def __init__(
        self, options: RunOptions, loaded: Description, world: World, simulation: Simulation
    ) -> None:
        super().__init__(options, loaded, world, simulation)
        file = options.drive_file
        settings = DiffDriveParameters() if file is None else file.parameters
        self.drive_unit = DiffDrive(loaded.robot, settings.changed(self.given))
        self.drive_unit.say = self.log.warning
        is_usual = options.preset == MBOT.preset
        self._other_presets = WASD_ADVICE if is_usual and not options.namespace else ''
        self._hints = KeyHints(self.logic, HELP_KEY, advice=self._other_presets, axes=('x', 'yaw'))
        self.notice = Notice()

    def prepare(self) -> None:
        """Apply the settings, before anything is scheduled."""
        super().prepare()
        unit, world, robot = self.drive_unit, self.world, self.description.robot
        geometry = unit.controller.geometry
        self._wheels = (geometry.left_joint, geometry.right_joint)
        world.actuation.is_kinematic = unit.is_fake
        missing = [name for name in self._wheels if name not in world.motor_names]
        if missing and not unit.is_fake:
            raise UserError(
                f'{robot.name}: no motor on {", ".join(missing)}: '
                'give the joint a <limit effort="..."/>'
            )
        self._motors = [world.motor_names.index(name) for name in self._wheels if not missing]
        self._places = world.parts.position[list(map(world.joint_names.index, self._wheels))]
        self._command = np.zeros((len(JointCommand._fields), len(world.motor_names)))
        self._wheel_links = [robot.joints[name].child for name in self._wheels]

    @property
    def given(self) -> dict[str, Any]:
        """The controller's parameters from the options, by name."""
        options, world = self.options, self.world
        given = {'controller': str(options.controller or ''), 'mode': options.drive_mode or ''}
        if world.prefix:
            # Of one of several robots; alone, a controller file may name them.
            given['odom_frame_id'] = f'{world.prefix}odom'
            given['base_frame_id'] = world.prefix + self.description.robot.root
        return {name: value for name, value in given.items() if value}

    @property
    def mode(self) -> str:
        """The drive's mode; the default one under the given word."""
        mode = self.settings.mode
        return (self.options.mode or MODES[0]) if mode == DRIVE_MODES[0] else mode

    @property
    def settings(self) -> DiffDriveParameters:
        """The drive's parameters that are in force."""
        return self.drive_unit.parameters

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the robot's oddities."""
        return tuple(self.drive_unit.notes)

    @property
    def state(self) -> str:
        """The controller's state."""
        return self.drive_unit.controller.state

    @property
    def period(self) -> float:
        """The controller's period [s]."""
        return 1.0 / self.drive_unit.update_rate

    @property
    def drive_limits(self) -> dict[str, float]:
        """A navigator's speed limits: at most those of the controller."""
        linear, angular = self.drive_unit.limits
        most = {
            'forward': (0.5, linear.forward),
            'backward': (0.2, linear.backward),
            'yaw': (1.5, angular.forward, angular.backward),
            'forward_acceleration': (0.8, linear.speed_up, linear.slow_down),
            'yaw_acceleration': (3.0, angular.speed_up, angular.slow_down),
        }
        return {name: min(limits) for name, limits in most.items()}

    @property
    def braking(self) -> tuple[float, float, float]:
        """The sure deceleration: its ramps, within the motors' limits."""
        linear, angular = self.drive_unit.limits
        ahead = min(linear.slow_down, linear.slow_down_backward, 1.0)
        return (ahead, 1.0, min(angular.slow_down, angular.slow_down_backward, 5.0))

    @property
    def braking_delay(self) -> float:
        """How long its ramps take to brake fully [s]: jerk has a limit."""
        return max(limits.braking_delay for limits in self.drive_unit.limits)

    def hold_back(self, limit: Callable[[Sequence[float]], np.ndarray]) -> None:
        """
        Limit each velocity (vx, vy, wz) of the controller by a guard.

        Raises:
            UserError: it uses the loops of the old firmware.
        """
        controller = self.drive_unit.controller
        if not isinstance(controller, DiffDriveController):
            raise UserError('--guard: does not work with legacy loops: leave one out')

        def held(velocity: DriveVelocity) -> DriveVelocity:
            vx, _, wz = limit((velocity.linear, 0.0, velocity.angular)).tolist()
            return DriveVelocity(vx, wz)

        controller.hold_back = held

    @property
    def geometry(self) -> DiffDriveGeometry:
        """The controller's geometry of the wheels."""
        return self.drive_unit.controller.geometry

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

    @property
    def odometry(self) -> BaseOdometry:
        """The odometry of its wheels."""
        return self.drive_unit.odometry

    @property
    def frames(self) -> tuple[str, str]:
        """The frames of odometry and of the base."""
        return self.settings.odom_frame_id, self.settings.base_frame_id

    def command(self, velocity: Velocity, age: float = 0.0) -> None:
        """Give the controller a velocity [m/s], [m/s], [rad/s] of any source, `age` [s] old."""
        linear, lateral, angular = velocity
        if not self.drive_unit.controller.command(linear, angular, age):
            words = f'velocity {linear:g} {lateral:g} {angular:g} is not finite: ignored'
            if self.notice.say(words):
                self.log.warning(words)

    def control(self) -> None:
        """Step the controller on the present state, and give its command to the world."""
        unit = self.drive_unit
        if unit.is_fake:  # it moves without physics, and is shown in the world
            unit.step_fake(self.period)
            x, y, yaw, linear, angular, lateral = unit.fake.pose
            states = zip(*map(unit.flip, (unit.fake.angles, unit.fake.speeds)), strict=True)
            pose = PlanarPose(x, y, yaw, linear, lateral, angular)
            place_robot(self.world, pose, dict(zip(self._wheels, states, strict=True)))
            return
        left, right = self.world.data.qpos[self._places].tolist()
        # Other motors than the wheels' stay limp: their columns are zero.
        command = unit.control(left, right, self.period)
        for row, part in zip(self._command, command, strict=True):
            row[self._motors] = part
        self.world.apply(JointCommand(*self._command))
        ahead, _, turn = self.world.base().planar_velocity.tolist()
        unit.watch(ahead, turn, self.period)

    def reset(self) -> None:
        """Forget the past: commands, ramps, odometry."""
        super().reset()
        self.drive_unit.reset()
        self.notice.say(None)

    def close(self) -> None:
        """Leave the wheels stopped."""
        super().close()
        self.drive_unit.reset()

    def sample(self) -> Sample:
        """Return the present sample of the report."""
        controller = self.drive_unit.controller
        pose = controller.odometry_state
        # Without physics there are no contact forces.
        forces = self.world.contact_forces(self._wheel_links) * (not self.drive_unit.is_fake)
        return Sample(
            controller.state,
            (controller.target.linear, 0.0, controller.target.angular),
            (pose.x, pose.y, pose.yaw),
            (forces > 0.0).astype(int).tolist(),
        )

    def _status(self) -> Status:
        logic, controller = self.logic, self.drive_unit.controller
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

    def _press(self, key: str, is_pressed: bool) -> None:
        super()._press(key, is_pressed)
        if is_press(key) and is_pressed:
            self.notice.say(self._hints.press(key))
