# SPDX-License-Identifier: Apache-2.0
"""The controller of mode arbotix with `legacy`: arbotix's own ramp, time-out and odometry."""

import math

from diff_drive_sim.arbotix_firmware import FRAMES_PER_SECOND
from diff_drive_sim.arbotix_host import ArbotixHost
from diff_drive_sim.arbotix_host import DEFAULT_ACCEL_LIMIT
from diff_drive_sim.arbotix_host import LOOP
from diff_drive_sim.controller import Velocity
from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.pose_covariance import PlanarCovariance
from diff_drive_sim.wheel_loop import count_ticks


class LegacyController:
    """
    DiffDriveController's interface to an ArbotixHost, which knows no limits but its ramp.

    Keeps the time since the start; the host looks at encoders each LOOP of it.
    """

    restarts = 0

    def __init__(
        self, geometry: DiffDriveGeometry, parameters: DiffDriveParameters, scale: float
    ) -> None:
        """Take the wheels and how many ticks there are to a radian."""
        self.geometry = geometry
        self.refused_commands = 0
        self._scale = scale
        self.host = ArbotixHost(parameters.ticks_meter, geometry.wheel_separation, parameters.rate)
        self.parameters = parameters
        self.reset()

    @property
    def parameters(self) -> DiffDriveParameters:
        """What is in force; time-out and ramp may change while it drives."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self._parameters = parameters
        limit = parameters.accel_limit
        self.host.configure(
            parameters.cmd_vel_timeout, DEFAULT_ACCEL_LIMIT if math.isnan(limit) else limit
        )

    def reset(self) -> None:
        """Stand still at the origin, with no command."""
        self._now = self._looked_at = 0  # [ns]
        self._has_command = False
        self._wanted = Velocity()
        self._new_age: float | None = None
        self.host.reset(0)

    def forget_command(self) -> None:
        """Be as if no command had ever come: the robot stops on arbotix's ramp."""
        self._has_command = False
        self._new_age = None
        self.host.command(0.0, 0.0, self._now)

    def reset_odometry(self) -> None:
        """Be at the origin, the robot going on as it does."""
        self.host.x = self.host.y = self.host.yaw = 0.0

    def set_odometry(self, x: float, y: float, yaw: float, covariance: PlanarCovariance) -> None:
        """Be at a pose [m], [rad]; arbotix knows no covariance."""
        self.host.x, self.host.y, self.host.yaw = x, y, yaw

    @property
    def velocity(self) -> Velocity:
        """The velocity that the set-points mean."""
        left, right = self._wheel_speeds()
        forward, turn = self.geometry.displacement(left, right)
        return Velocity(forward, turn)

    @property
    def target(self) -> Velocity:
        """The last command, or zero when it is too old."""
        return self._wanted if self._has_command and not self.host.timed_out else Velocity()

    @property
    def state(self) -> str:
        """`driving`, `stopped` or `timed out`."""
        if self.host.setpoints == (0, 0) and self.target == Velocity():
            return 'stopped'
        return 'timed out' if self.host.timed_out else 'driving'

    @property
    def odometry_state(self) -> OdometryState:
        """Pose and twist as arbotix computes them."""
        host = self.host
        return OdometryState(host.x, host.y, host.yaw, host.linear, host.angular)

    @property
    def covariance(self) -> PlanarCovariance:
        """Zeros, as arbotix's."""
        return PlanarCovariance()

    def command(self, linear: float, angular: float, age: float = 0.0) -> bool:
        """Take a velocity command [m/s], [rad/s]; one that is not finite is refused."""
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.refused_commands += 1
            return False
        self._wanted = Velocity(linear, angular)
        self._has_command = True
        self._new_age = age
        self.host.command(linear, angular, self._now)
        return True

    def step(self, left: float, right: float, dt: float, late: float = 0.0) -> tuple[float, float]:
        """
        Return the wheel speeds [rad/s] that the set-points mean, for wheel angles [rad].

        They are `dt` [s] after the last ones; a command that has come since came `late` [s] ago.
        """
        self._now += round(1e9 * dt)
        if self._new_age is not None:
            self.host.command(*self._wanted, self._now - round(1e9 * (self._new_age + late)))
            self._new_age = None
        if self._now - self._looked_at >= LOOP:
            self._looked_at = self._now
            geometry = self.geometry
            self.host.update(
                self._now,
                count_ticks(geometry.left_direction * left, self._scale),
                count_ticks(geometry.right_direction * right, self._scale),
            )
        return self._wheel_speeds()

    def _wheel_speeds(self) -> tuple[float, float]:
        left, right = self.host.setpoints
        speed = FRAMES_PER_SECOND / self._scale  # of one tick per frame [rad/s]
        return (
            self.geometry.left_direction * left * speed,
            self.geometry.right_direction * right * speed,
        )
