# SPDX-License-Identifier: Apache-2.0
"""One robot's drive put together: geometry, motor, controller, wheel loops or arithmetic."""

from collections.abc import Callable, Iterator
from dataclasses import replace
import math

import numpy as np
from robot_description.morphology.equip_wheels import strength
from robot_description.robot import Robot
from wasd_core.robot_io import BaseOdometry, JointCommand
from wasd_core.timing import Watchdog

from diff_drive_sim.arbotix import ArbotixDrive, LegacyController, setpoints_of
from diff_drive_sim.controller import DiffDriveController, MAXIMUM_STEP, Velocity
from diff_drive_sim.odometry import (
    DiffDriveGeometry,
    find_pair,
    geometry_of,
    OdometryState,
    Pair,
    WheelOdometry,
)
from diff_drive_sim.parameters import DiffDriveParameters, WheelParameters
from diff_drive_sim.shortfall import Shortfall
from diff_drive_sim.wheel_loop import (
    count_ticks,
    Gains,
    is_gap,
    wheel_motor,
    WheelLoop,
    WheelMotor,
)

Controller = DiffDriveController | LegacyController
# Of the torque that motors have a ramp uses so much: the loop needs some, too.
USED_SHARE = 0.8
JUMPED = (
    'the wheel angles have jumped (was the robot reset?): odometry continues from its last pose'
)
# That is said again only after this [s].
JUMPS_SAID = 5.0


class FloatDrive:
    """Two wheel loops with fractions."""

    def __init__(self, gains: Gains, motor: WheelMotor, scale: float, delay: int) -> None:
        self._loops = (
            WheelLoop(gains, motor, scale, delay),
            WheelLoop(gains, motor, scale, delay),
        )

    def step(self, speeds: Pair, ticks: tuple[int, int], dt: float) -> Pair:
        """Return duties, -1 to 1, for forward wheel speeds [rad/s]; `dt` [s] after the last."""
        left, right = self._loops
        return left.step(speeds[0], ticks[0], dt), right.step(speeds[1], ticks[1], dt)

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""
        for loop in self._loops:
            loop.gains = gains

    def reset(self) -> None:
        """Forget the past."""
        for loop in self._loops:
            loop.reset()


def gains_of(parameters: DiffDriveParameters) -> Gains:
    """Return the loop's gains."""
    return Gains(parameters.Kp, parameters.Kd, parameters.Ki, parameters.Ko)


class KinematicBase:
    """
    Two wheels without slip, motors or mass: what mode fake drives.

    Keeps the wheels' angles and the true pose; `step` turns the wheels at speeds [rad/s] for a
    time [s].
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self._rolling = WheelOdometry(geometry)
        self.reset()

    def reset(self) -> None:
        """Be at the origin, the wheels at angle 0."""
        self._rolling.reset()
        self.angles = (0.0, 0.0)
        self.speeds = (0.0, 0.0)
        self._rolling.step(*self.angles, 0.0)

    @property
    def pose(self) -> OdometryState:
        """Where it is, and its velocity."""
        return self._rolling.state

    def step(self, left: float, right: float, dt: float) -> None:
        """Turn the wheels at speeds [rad/s] for `dt` [s]."""
        self.speeds = (left, right)
        self.angles = (self.angles[0] + left * dt, self.angles[1] + right * dt)
        self._rolling.step(*self.angles, dt)


class DiffDrive:
    """
    Wheel angles in, speeds of the unloaded motors out.

    Both are the joints', whose signs `flip` changes; all that is inside counts forward: the last
    wheel angles [rad], their speeds [rad/s] and the encoders' ticks. In mode fake the wheels are
    its own. `notes` are what the parameters contradict and what the motors are too weak for, in
    words; `say` hears what is worth a line while it drives.
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
        described = geometry_of(pair)
        self.motor = wheel_motor(robot, pair)
        described = replace(described, speed_limit=self.motor.top_speed)
        geometry, notes = configure_wheels(described, parameters)
        ahead, turning = strength(robot, pair)
        self._strength = ahead.scaled(USED_SHARE), turning.scaled(USED_SHARE)
        self._weakest = pair.weakest.joint
        self._slower = min(pair.wheels, key=lambda wheel: wheel.joint.velocity or math.inf).joint
        self.notes = (*notes, *self._weaknesses(parameters, geometry))
        self._jumped = Watchdog(JUMPS_SAID)
        self._has_said = self._has_said_short = False
        self._shortfall = Shortfall(0.5 * geometry.wheel_separation)
        # Ticks belong to the wheel that is there, whatever radius it is believed to have.
        self._scale = parameters.ticks_meter * described.wheel_radius
        self.controller, self._drive = self._make_loops(geometry, parameters)
        self.flip = geometry.flip
        self.fake = KinematicBase(geometry)
        self.angles = self.wheel_velocities = (0.0, 0.0)
        self._counts_ticks = parameters.odometry_feedback == 'ticks'

    def _make_loops(
        self, geometry: DiffDriveGeometry, parameters: DiffDriveParameters
    ) -> tuple[Controller, FloatDrive | ArbotixDrive]:
        """Return what turns commands into wheel speeds, and what these into duties."""
        gains = gains_of(parameters)
        if parameters.legacy:
            legacy = LegacyController(geometry, parameters, self._scale)
            return legacy, ArbotixDrive(gains, lambda: legacy.host.setpoints)
        controller = DiffDriveController(geometry, parameters, self._strength)
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

    def _with_base_frame(self, parameters: DiffDriveParameters) -> DiffDriveParameters:
        return replace(parameters, base_frame_id=parameters.base_frame_id or self.robot.root)

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
            np.array((state.x, state.y, 0.0)),
            np.array((math.cos(0.5 * state.yaw), 0.0, 0.0, math.sin(0.5 * state.yaw))),
            np.array((state.linear, state.lateral, 0.0)),
            np.array((0.0, 0.0, state.angular)),
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
