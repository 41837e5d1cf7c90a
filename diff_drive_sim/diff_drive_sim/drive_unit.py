# SPDX-License-Identifier: Apache-2.0
"""One robot's drive put together: geometry, motor, controller, wheel loops or arithmetic."""

from robot_description.robot import Robot

from diff_drive_sim.controller import Controller
from diff_drive_sim.controller import DiffDriveController
from diff_drive_sim.controller import MAXIMUM_STEP
from diff_drive_sim.geometry import configured
from diff_drive_sim.geometry import find_wheels
from diff_drive_sim.kinematic_base import KinematicBase
from diff_drive_sim.legacy_controller import LegacyController
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.wheel_drive import ArbotixDrive
from diff_drive_sim.wheel_drive import FloatDrive
from diff_drive_sim.wheel_drive import gains_of
from diff_drive_sim.wheel_drive import WheelDrive
from diff_drive_sim.wheel_loop import count_ticks
from diff_drive_sim.wheel_loop import is_gap
from diff_drive_sim.wheel_motor import wheel_motor


class DriveUnit:
    """
    Wheel angles in, speeds of the unloaded motors out.

    Keeps the last wheel angles [rad], their speeds [rad/s] and the encoders' ticks; in mode fake
    the wheels are its own. `notes` are what the parameters contradict, in words.

    Raises:
        DiffDriveError: the robot has no two wheels on an axle.
    """

    def __init__(self, robot: Robot, parameters: DiffDriveParameters, delay: int = 0) -> None:
        """Take a robot; `delay` is how many steps a command takes to reach the motors."""
        described = find_wheels(
            robot, (*parameters.left_wheel_names, *parameters.right_wheel_names)
        )
        geometry, self.notes = configured(described, parameters)
        # Ticks belong to the wheel that is there, whatever radius it is believed to have.
        self._scale = parameters.ticks_meter * described.wheel_radius
        self.controller: Controller
        if parameters.legacy:
            self.controller = LegacyController(geometry, parameters, self._scale)
        else:
            self.controller = DiffDriveController(geometry, parameters)
        gains = gains_of(parameters)
        self.motor = wheel_motor(robot, described)
        self._drive: WheelDrive
        if parameters.mode == 'arbotix':
            self._drive = ArbotixDrive(gains, self.controller)
        else:
            self._drive = FloatDrive(gains, self.motor, self._scale, delay)
        self.fake = KinematicBase(geometry)
        self.angles = self.wheel_velocities = (0.0, 0.0)
        self._directions = (geometry.left_direction, geometry.right_direction)
        self._counts_ticks = parameters.odometry_feedback == 'ticks'

    @property
    def parameters(self) -> DiffDriveParameters:
        """What is in force; what may change while it drives does so at once."""
        return self.controller.parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self.controller.parameters = parameters
        self._drive.set_gains(gains_of(parameters))

    @property
    def ticks(self) -> tuple[int, int]:
        """What the encoders show, counting forward."""
        left, right = (
            count_ticks(direction * angle, self._scale)
            for direction, angle in zip(self._directions, self.angles, strict=True)
        )
        return left, right

    def reset(self) -> None:
        """Stand still at the origin, with no past."""
        self.controller.reset()
        self._drive.reset()
        self.fake.reset()

    def step(self, left: float, right: float, dt: float, late: float = 0.0) -> tuple[float, float]:
        """
        Return the speeds [rad/s] that the motors would have without load: duty times no-load.

        `left`, `right` are the wheel angles now [rad], `dt` [s] after the last ones; a command
        that has come since those came `late` [s] before these. After a gap the wheels' loops
        begin anew: they do not catch up.
        """
        speeds = self._control(left, right, dt, late)
        forward = (self._directions[0] * speeds[0], self._directions[1] * speeds[1])
        duties = self._drive.step(forward, self.ticks, dt)
        return (
            self._directions[0] * duties[0] * self.motor.speed,
            self._directions[1] * duties[1] * self.motor.speed,
        )

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
            counted = zip(self._directions, self.ticks, strict=True)
            left, right = (direction * ticks / self._scale for direction, ticks in counted)
        speeds = self.controller.step(left, right, dt, late)
        if self.controller.restarts > restarts or is_gap(dt):
            self._drive.reset()
        return speeds
