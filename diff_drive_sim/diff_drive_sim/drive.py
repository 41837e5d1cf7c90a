# SPDX-License-Identifier: Apache-2.0
"""
One robot's drive: velocity commands and wheel angles in, commands of the motors out.

The controller makes wheel speeds of the command in force; a drive puts it together with geometry,
motors, and wheel loops or arithmetic.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
import math

import numpy as np
from robot_description.morphology.equip_wheels import Strength, strength
from robot_description.robot import Robot
from wasd_core.robot_io import BaseOdometry, JointCommand
from wasd_core.timing import TWIST_RATE, Watchdog

from diff_drive_sim.arbotix import ArbotixDrive, LegacyController, setpoints_of
from diff_drive_sim.limits import PlanarRamp, Velocity
from diff_drive_sim.odometry import (
    DiffDriveGeometry,
    find_pair,
    geometry_of,
    Growth,
    KinematicBase,
    OdometryState,
    PlanarCovariance,
    WheelOdometry,
)
from diff_drive_sim.parameters import DiffDriveParameters, WheelParameters
from diff_drive_sim.shortfall import Shortfall
from diff_drive_sim.wheel_loop import count_ticks, FloatDrive, Gains, is_gap, wheel_motor

# Of the torque that motors have a ramp uses so much: the loop needs some, too.
USED_SHARE = 0.8
JUMPED = (
    'the wheel angles have jumped (was the robot reset?): odometry continues from its last pose'
)
# That is said again only after this [s].
JUMPS_SAID = 5.0


def gains_of(parameters: DiffDriveParameters) -> Gains:
    """Return the loop's gains."""
    return Gains(parameters.Kp, parameters.Kd, parameters.Ki, parameters.Ko)


# A ramp goes on for no longer than this after a gap [s]: the robot eases in, not jumps. Nothing
# else is cut short: a command has the age that it has.
MAXIMUM_STEP = 0.1


class DiffDriveController:
    """
    Follows the last velocity command with bounded velocity, acceleration and jerk.

    Keeps the command and its age, the velocity reached so far and the odometry. One `step` is
    one control period: wheel angles in, wheel speeds out. `lowered` is the last command that was
    too fast for a wheel, and what it became.
    """

    def __init__(
        self,
        geometry: DiffDriveGeometry,
        parameters: DiffDriveParameters,
        strength: tuple[Strength, Strength] = (Strength(), Strength()),
    ) -> None:
        """Take wheels and parameters; `strength` is what motors can do, ahead and in a turn."""
        self.geometry = geometry
        self._strength = strength
        self.odometry = WheelOdometry(geometry, parameters.velocity_rolling_window_size)
        self._ramp = PlanarRamp(geometry)
        self._command_age = Watchdog(parameters.cmd_vel_timeout)
        self.parameters = parameters
        # What a guard leaves of the command in force.
        self.hold_back: Callable[[Velocity], Velocity] = lambda velocity: velocity
        self.refused_commands = 0
        self.lowered: tuple[Velocity, Velocity] | None = None
        self.reset()

    def reset(self) -> None:
        """Stand still at the origin, with no command."""
        self.odometry.reset()
        self.velocity = Velocity()
        self._ramp.reset()
        self._wanted = Velocity()
        self.forget_command()

    def forget_command(self) -> None:
        """Forget the command: the robot stops on its ramp."""
        self._command_age.reset()
        self._is_new = False

    def set_odometry(self, x: float, y: float, yaw: float, covariance: PlanarCovariance) -> None:
        """Be at a pose [m], [rad], the robot going on as it does."""
        self.odometry.set_pose(x, y, yaw, covariance)

    @property
    def parameters(self) -> DiffDriveParameters:
        """Limits and time-out; new ones act on the command in force."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self._parameters = parameters
        separation = self.geometry.wheel_separation
        ahead, turning = self._strength
        linear = parameters.linear_limits().within(ahead)
        angular = parameters.angular_limits(separation).within(turning)
        self._ramp.linear.limits, self._ramp.angular.limits = linear, angular
        self._command_age.timeout = parameters.cmd_vel_timeout
        self.odometry.growth = Growth(
            parameters.distance_variance, parameters.turn_variance, parameters.drift_variance
        )
        geometry = self.geometry
        rim = max(linear.forward, linear.backward)
        rim += 0.5 * geometry.wheel_separation * max(angular.forward, angular.backward)
        smallest = min(geometry.left_radius, geometry.right_radius)
        self._speed_limit = min(rim / smallest, geometry.speed_limit)

    @property
    def target(self) -> Velocity:
        """
        The command in force: the last one within the limits, or zero when it is too old.

        What is beyond a limit of the robot or of its wheels is slowed down as a whole, so that
        the robot keeps to the curve it was asked to take.
        """
        return self._slow_down(self._limited())

    def _limited(self) -> Velocity:
        """Return the command in force within the limits of the axes."""
        if self.timed_out:
            return Velocity()
        linear, angular = self._wanted
        limits = self._ramp.linear.limits, self._ramp.angular.limits
        share = min(limits[0].share(linear), limits[1].share(angular))
        return Velocity(share * linear, share * angular)

    @property
    def timed_out(self) -> bool:
        """Whether there has been no command for longer than the time-out."""
        return not self._command_age.is_alive

    @property
    def state(self) -> str:
        """`driving`, `stopped`, or `timed out` when it stops because commands have ceased."""
        if self.velocity == Velocity() and self.target == Velocity():
            return 'stopped'
        return 'timed out' if self.timed_out else 'driving'

    def command(self, linear: float, angular: float, age: float = 0.0) -> bool:
        """
        Take a velocity command [m/s], [rad/s] of an age [s] and return whether it was taken.

        It is in force from the next step on, which may make it older. One that is not finite is
        refused and the previous one stays.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.refused_commands += 1
            return False
        self._wanted = Velocity(linear, angular)
        self._command_age.hear(age)
        self._is_new = True
        return True

    def step(self, left: float, right: float, dt: float, late: float = 0.0) -> tuple[float, float]:
        """
        Return left and right wheel speed [rad/s].

        `left`, `right` are the wheel angles now [rad], `dt` [s] after the last ones; a command
        that has come since those came `late` [s] before these.
        """
        # After a limit was lowered the wheels are faster than it for a while: as commanded.
        commanded = map(abs, self.geometry.wheel_speeds(*self.velocity))
        self.odometry.speed_limit = max(self._speed_limit, *commanded)
        if self.parameters.open_loop:
            self.odometry.advance(*self.velocity, dt)
        else:
            self.odometry.step(left, right, dt)
        self._command_age.step(late if self._is_new else dt)
        self._is_new = False
        limited = self._limited()
        target = self._slow_down(limited)
        if target != limited:
            self.lowered = limited, target
        target = self.hold_back(target)
        self.velocity = self._ramp.step(*target, self._ramp_time(dt))
        return self.geometry.wheel_speeds(*self.velocity)

    def _ramp_time(self, dt: float) -> float:
        """Return for how long the ramp goes on [s]: a stop that was due in a gap is over."""
        if not self.timed_out:
            return min(dt, MAXIMUM_STEP)
        return min(dt, max(MAXIMUM_STEP, self._command_age.age - self._command_age.timeout))

    @property
    def odometry_state(self) -> OdometryState:
        """Pose and twist by the wheels."""
        return self.odometry.state

    @property
    def covariance(self) -> PlanarCovariance:
        """How sure the pose is."""
        return self.odometry.covariance

    @property
    def restarts(self) -> int:
        """How often the wheel angles have jumped."""
        return self.odometry.restarts

    def _slow_down(self, velocity: Velocity) -> Velocity:
        """Return the velocity, slowed down as a whole to what the faster wheel can do."""
        fastest = max(map(abs, self.geometry.wheel_speeds(*velocity)))
        limit = self.geometry.speed_limit
        share = limit / fastest if fastest > limit else 1.0
        return Velocity(share * velocity.linear, share * velocity.angular)


Controller = DiffDriveController | LegacyController


class DiffDrive:
    """
    Wheel angles in, speeds of the unloaded motors out.

    Both are the joints', whose signs `flip` changes; all that is inside counts forward: the last
    wheel angles [rad], their speeds [rad/s] and the encoders' ticks. In mode fake the wheels are
    its own. `limits` are those of speed and yaw rate in force. `notes` are what the parameters
    contradict and what the motors are too weak for, in words; `say` hears what is worth a line
    while it drives.
    """

    notes: tuple[str, ...]
    controller: Controller

    def __init__(
        self, robot: Robot, parameters: DiffDriveParameters | None = None, delay: int = 0
    ) -> None:
        """
        Take a robot; without parameters `configure` is to be called before anything else.

        `delay` is how many steps a command takes to reach the motors.

        Raises:
            DiffDriveError: the robot has no two wheels on an axle.
        """
        self.robot, self._delay = robot, delay
        self.say: Callable[[str], None] = lambda _: None
        if parameters is not None:
            self.configure(parameters)

    def configure(self, parameters: DiffDriveParameters) -> None:
        """
        Begin with parameters, also with those that only hold from the start.

        Raises:
            DiffDriveError: the robot has no such wheels.
        """
        robot = self.robot
        parameters = self._with_base_frame(parameters)
        pair = find_pair(robot, parameters.wheel_choice())
        described = geometry_of(robot, pair)
        self.motor = wheel_motor(robot, pair)
        described = replace(described, speed_limit=self.motor.top_speed)
        geometry, notes = configure_wheels(described, parameters)
        ahead, turning = strength(robot, pair)
        self._strength = ahead.scaled(USED_SHARE), turning.scaled(USED_SHARE)
        self._weakest = pair.weakest.joint
        self._slower = min(pair.wheels, key=lambda wheel: wheel.joint.velocity or math.inf).joint
        timeout = parameters.cmd_vel_timeout
        if 0.0 < timeout < 1.0 / TWIST_RATE:
            notes += (
                f'cmd_vel_timeout is {timeout:g} s, but scripts, the stick and goals command '
                f'every {1.0 / TWIST_RATE:g} s: the robot brakes in between; usual is 0.5',
            )
        self.notes = (*notes, *self._weaknesses(parameters, geometry))
        self._jumped = Watchdog(JUMPS_SAID)
        self._has_said = self._has_said_short = False
        self._shortfall = Shortfall(0.5 * geometry.wheel_separation)
        # Ticks belong to the wheel that is there, whatever radius it is believed to have.
        self._scale = parameters.ticks_meter * described.wheel_radius
        self._counts_ticks = parameters.odometry_feedback == 'ticks'
        self.controller, self._drive = self._make_loops(geometry, parameters)
        self._take_limits()
        self.flip = geometry.flip
        self.fake = KinematicBase(geometry)
        self.angles = self.wheel_velocities = (0.0, 0.0)

    def _make_loops(
        self, geometry: DiffDriveGeometry, parameters: DiffDriveParameters
    ) -> tuple[Controller, FloatDrive | ArbotixDrive]:
        """Return what turns commands into wheel speeds, and what these into duties."""
        gains = gains_of(parameters)
        if parameters.legacy:
            legacy = LegacyController(geometry, parameters, self._scale)
            return legacy, ArbotixDrive(gains, lambda: legacy.host.setpoints)
        controller = DiffDriveController(geometry, parameters, self._strength)
        controller.odometry.resolution = 1.0 / self._scale if self._counts_ticks else 0.0
        if parameters.mode != 'arbotix':
            return controller, FloatDrive(gains, self.motor, self._scale, self._delay)
        separation, scale = geometry.wheel_separation, parameters.ticks_meter

        def setpoints() -> tuple[int, int]:
            return setpoints_of(*controller.velocity, separation, scale)

        return controller, ArbotixDrive(gains, setpoints)

    @property
    def parameters(self) -> DiffDriveParameters:
        """What is in force, the base frame named; what may change while it drives does at once."""
        return self.controller.parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self.controller.parameters = self._with_base_frame(parameters)
        self._drive.set_gains(gains_of(parameters))
        self._take_limits()

    def _take_limits(self) -> None:
        separation, (ahead, turning) = self.controller.geometry.wheel_separation, self._strength
        parameters = self.parameters
        linear, angular = parameters.linear_limits(), parameters.angular_limits(separation)
        self.limits = linear.reached_by(ahead), angular.reached_by(turning)

    def _with_base_frame(self, parameters: DiffDriveParameters) -> DiffDriveParameters:
        frame = parameters.base_frame_id or self.robot.root
        return replace(parameters, base_frame_id=frame)

    @property
    def is_fake(self) -> bool:
        """Whether its wheels are of arithmetic: `step_fake` is for these, `control` for others."""
        return self.parameters.mode == 'fake'

    @property
    def update_rate(self) -> float:
        """How often it is to be stepped [Hz]; a frame of the firmware is 17 of its steps."""
        return 500.0 if self.parameters.mode == 'arbotix' else self.parameters.update_rate

    @property
    def ticks(self) -> tuple[int, int]:
        """What the encoders show, counting forward."""
        left, right = self.angles
        return count_ticks(left, self._scale), count_ticks(right, self._scale)

    @property
    def odometry(self) -> BaseOdometry:
        """Where the wheels say it is, and how sure that is."""
        controller, parameters = self.controller, self.parameters
        state, sure = controller.odometry_state, controller.covariance
        pose = np.diag(parameters.pose_covariance_diagonal)
        pose[0, 0] += sure.xx
        pose[1, 1] += sure.yy
        pose[5, 5] += sure.yaw_yaw
        pose[0, 1] = pose[1, 0] = sure.xy
        pose[0, 5] = pose[5, 0] = sure.x_yaw
        pose[1, 5] = pose[5, 1] = sure.y_yaw
        twist, error = np.diag(parameters.twist_covariance_diagonal), parameters.twist_error
        twist[0, 0] += (error * state.linear) ** 2
        twist[1, 1] += (error * state.lateral) ** 2
        twist[5, 5] += (error * state.angular) ** 2
        return BaseOdometry(
            state.position,
            state.orientation,
            state.linear_velocity,
            state.angular_velocity,
            pose,
            twist,
        )

    def reset(self) -> None:
        """Stand still at the origin, with no past."""
        self.controller.reset()
        self._drive.reset()
        self.fake.reset()
        self._shortfall.reset()

    def watch(self, ahead: float, turn: float, dt: float) -> None:
        """
        Look how fast the robot really is [m/s], [rad/s], `dt` [s] after the last look.

        Says once that it falls short of a steady command.
        """
        if self._has_said_short:
            return
        controller = self.controller
        wheels = Velocity(*controller.geometry.displacement(*self.wheel_velocities))
        velocity = Velocity(*controller.velocity)
        line = self._shortfall.step(velocity, wheels, Velocity(ahead, turn), dt)
        if line:
            self._has_said_short = True
            self.say(line)

    def control(self, left: float, right: float, dt: float, late: float = 0.0) -> JointCommand:
        """Return the command of the two motors, left then right, for what `step` takes."""
        restarts = self.controller.restarts
        speeds = np.array(self.step(left, right, dt, late))
        self._jumped.step(dt)
        if self.controller.restarts > restarts and not self._jumped.is_alive:
            self._jumped.hear()
            self.say(JUMPED)
        none = np.zeros(2)
        return JointCommand(none, speeds, none, none, np.full(2, self.motor.damping))

    def step(self, left: float, right: float, dt: float, late: float = 0.0) -> tuple[float, float]:
        """
        Return the speeds [rad/s] that the motors would have without load: duty times no-load.

        `left`, `right` are the joint angles now [rad], `dt` [s] after the last ones; a command
        that has come since those came `late` [s] before these. After a gap the wheels' loops
        begin again: they do not catch up.
        """
        speeds = self._control(*self.flip((left, right)), dt, late)
        duties = self._drive.step(speeds, self.ticks, dt)
        return self.flip((duties[0] * self.motor.speed, duties[1] * self.motor.speed))

    def step_fake(self, dt: float, late: float = 0.0) -> None:
        """
        Let wheels of arithmetic roll for `dt` [s], then look at them and at the command.

        In a gap, in which nobody looked at the command, they stand.
        """
        self.fake.step(*self.fake.speeds, min(dt, MAXIMUM_STEP))
        self.fake.speeds = self._control(*self.fake.angles, dt, late)

    def _control(self, left: float, right: float, dt: float, late: float) -> tuple[float, float]:
        if dt > 0.0:
            before, now = self.angles, (left, right)
            self.wheel_velocities = ((now[0] - before[0]) / dt, (now[1] - before[1]) / dt)
        self.angles = (left, right)
        restarts = self.controller.restarts
        if self._counts_ticks:
            left, right = (ticks / self._scale for ticks in self.ticks)
        speeds = self.controller.step(left, right, dt, late)
        if not self._has_said and isinstance(self.controller, DiffDriveController):
            self._say_lowered(self.controller)
        if self.controller.restarts > restarts or is_gap(dt):
            self._drive.reset()
        return speeds

    def _say_lowered(self, controller: DiffDriveController) -> None:
        """Say once that a command was too fast for a wheel."""
        if controller.lowered is None:
            return
        self._has_said = True
        wanted, became = controller.lowered
        self.say(
            f'{self._slower.name} turns at {controller.geometry.speed_limit:.3g} rad/s at most: '
            f'{became.linear:.3g} m/s and {became.angular:.3g} rad/s in place of '
            f'{wanted.linear:.3g} m/s and {wanted.angular:.3g} rad/s'
        )

    def _weaknesses(
        self, parameters: DiffDriveParameters, geometry: DiffDriveGeometry
    ) -> Iterator[str]:
        """Yield what the motors are too weak for."""
        name = f'{self._weakest.name} has {self._weakest.effort:g} N m'
        if self._strength[0].speed_up == 0.0:
            yield f'{name}, its own friction takes {self._weakest.friction:g}: it does not move'
            return
        for axis, unit, limits, most in (
            ('linear.x', 'm/s^2', parameters.linear_limits(), self._strength[0]),
            ('angular.z', 'rad/s^2', parameters.angular_limits(geometry.wheel_separation),
             self._strength[1]),
        ):  # fmt: skip
            if limits.within(most).speed_up < limits.speed_up:
                yield (
                    f'{name}: enough for {most.speed_up:.2g} {unit}, not for the '
                    f'{limits.speed_up:g} of {axis}.max_acceleration'
                )


def configure_wheels(
    geometry: DiffDriveGeometry, parameters: WheelParameters
) -> tuple[DiffDriveGeometry, tuple[str, ...]]:
    """Return the geometry that the parameters ask for, and in words what is odd."""
    notes = []
    left, right = geometry.left_joint, geometry.right_joint
    if 'right' in left.lower() and 'left' in right.lower():
        notes.append(f'{left} is on the left and {right} on the right: their names are swapped')
    elif parameters.left_wheel_names not in ((), (left,)):
        notes.append(
            f'left_wheel_names names {parameters.left_wheel_names[0]}, which is on the right: '
            f'{left} is taken as the left one'
        )
    changes = {}
    multiplier = parameters.wheel_separation_multiplier
    for name in ('wheel_separation', 'wheel_radius'):
        described, wanted = getattr(geometry, name), getattr(parameters, name)
        if wanted == 0.0:
            continue
        changes[name] = wanted
        # A separation that has been calibrated is not odd.
        is_calibrated = name == 'wheel_separation' and multiplier != 1.0
        if not is_calibrated and not math.isclose(wanted, described, rel_tol=1e-6):
            notes.append(
                f'{name} is {wanted:g} m, but {described:g} m in the description: using '
                f'{wanted:g} (ratio {wanted / described:.3f})'
            )
    return replace(
        geometry,
        wheel_radius=changes.get('wheel_radius', geometry.wheel_radius),
        wheel_separation=multiplier * changes.get('wheel_separation', geometry.wheel_separation),
        left_multiplier=geometry.left_multiplier * parameters.left_wheel_radius_multiplier,
        right_multiplier=geometry.right_multiplier * parameters.right_wheel_radius_multiplier,
    ), tuple(notes)
