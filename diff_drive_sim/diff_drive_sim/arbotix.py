# SPDX-License-Identifier: Apache-2.0
"""
The ArbotiX board and its driver as they are, slips included.

The board's wheel loop computes in integers, as its firmware does; the host is arbotix_driver's
diff_controller as it was: ramp, time-out and odometry.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

from diff_drive_sim.limits import Velocity
from diff_drive_sim.odometry import DiffDriveGeometry, OdometryState, Pair, PlanarCovariance
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.wheel_loop import count_ticks, FULL_PWM, Gains

# The board looks at its milliseconds and waits until more than so many have passed.
FRAME_MILLISECONDS = 33
# What the board believes a second has: set-points are ticks in one of these.
FRAMES_PER_SECOND = 30.0
MOST_TICKS = 0x7FFF


@dataclass
class _Wheel:
    """One wheel's registers."""

    velocity: int = 0
    encoder_before: int = 0
    error_before: int = 0
    error_sum: int = 0
    pwm: int = 0

    def update(self, encoder: int, gains: tuple[int, int, int, int]) -> None:
        kp, kd, ki, ko = gains
        error = self.velocity - (encoder - self.encoder_before)
        # An AVR's int has 16 bits, and so has the product of two of them.
        correction = kp * error + kd * (error - self.error_before) + int16(ki * self.error_sum)
        self.error_before = int16(error)
        self.encoder_before = encoder
        pwm = self.pwm + divide_like_c(correction, ko)
        if abs(pwm) >= FULL_PWM:
            self.pwm = FULL_PWM if pwm > 0 else -FULL_PWM
        else:
            self.pwm = pwm
            self.error_sum = int16(self.error_sum + error)


class ArbotixFirmware:
    """
    Two wheels, their set-points and PWM.

    `write` is what the host sends, `update` the board's main loop. The loop is armed by the first
    set-point that is not zero and disarmed, at once, when both are: the board knows no ramp.
    """

    def __init__(self, gains: Gains) -> None:
        self.setup(gains)
        self.reset()

    def setup(self, gains: Gains) -> None:
        """Take gains, one unsigned byte each."""
        self._gains = (int(gains.Kp), int(gains.Kd), int(gains.Ki), int(gains.Ko))

    def reset(self) -> None:
        """Be as after power-on."""
        self._left, self._right = _Wheel(), _Wheel()
        self._armed = False
        self._next_frame = 0  # [ms]

    @property
    def pwm(self) -> tuple[int, int]:
        """What the motors get, left and right, -255 to 255."""
        return self._left.pwm, self._right.pwm

    def write(self, left: int, right: int, left_ticks: int, right_ticks: int) -> None:
        """Take set-points [ticks per 1/30 s]; the encoders are where they are now."""
        left, right = int16(left), int16(right)
        if left == right == 0:
            self._armed = False
            for wheel in (self._left, self._right):
                wheel.error_before = wheel.error_sum = wheel.pwm = 0
        elif self._left.velocity == self._right.velocity == 0:
            self._armed = True
            self._left.encoder_before, self._right.encoder_before = left_ticks, right_ticks
        self._left.velocity, self._right.velocity = left, right

    def update(self, milliseconds: int, left_ticks: int, right_ticks: int) -> None:
        """Run the loops if a frame is due at this time of the board's clock."""
        if self._armed and milliseconds > self._next_frame:
            self._left.update(left_ticks, self._gains)
            self._right.update(right_ticks, self._gains)
            self._next_frame = milliseconds + FRAME_MILLISECONDS


class ArbotixDrive:
    """The board: its firmware, fed with the set-points that arbotix_driver sends."""

    def __init__(self, gains: Gains, setpoints: Callable[[], tuple[int, int]]) -> None:
        """Take what returns the set-points of now, left and right [ticks per 1/30 s]."""
        self._setpoints = setpoints
        self._firmware = ArbotixFirmware(gains)
        self.reset()

    def step(self, speeds: Pair, ticks: tuple[int, int], dt: float) -> Pair:
        """Return duties, -1 to 1; `speeds` are implied by the set-points."""
        self._time += dt
        self._firmware.write(*self._setpoints(), *ticks)
        self._firmware.update(math.floor(1e3 * self._time + 1e-6), *ticks)
        pwm = self._firmware.pwm
        return pwm[0] / FULL_PWM, pwm[1] / FULL_PWM

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""
        self._firmware.setup(gains)

    def reset(self) -> None:
        """Be as after power-on."""
        self._time = 0.0
        self._firmware.reset()


def divide_like_c(value: int, divisor: int) -> int:
    """Return a quotient without its fraction, as C divides; `divisor` > 0."""
    quotient = abs(value) // divisor
    return quotient if value >= 0 else -quotient


def int16(value: int) -> int:
    """Return what 16 bits keep of a number."""
    return (value + 0x8000) % 0x10000 - 0x8000


# The driver's main loop looks at the controller this often [ns].
LOOP = 10_000_000
# What arbotix takes when accel_limit is not given [m/s^2].
DEFAULT_ACCEL_LIMIT = 0.1


class ArbotixHost:
    """
    Takes velocities, gives set-points [ticks per 1/30 s], and makes odometry from encoders.

    Known slips, kept: the ramp adds ticks per second to ticks per 1/30 s, so it is 30 times as
    steep as accel_limit says, and ramps each wheel by itself; odometry lays a path along the
    heading before it minus the turn, where plus half of it would be right; the next update is
    due one period after the last one that came late.
    """

    def __init__(self, ticks_meter: float, base_width: float, rate: float = 10.0) -> None:
        self._ticks_meter = ticks_meter
        self._base_width = base_width
        self._rate = rate
        self._period = round(1e9 / rate)
        self.configure(1.0, DEFAULT_ACCEL_LIMIT)
        self.reset(0)

    def configure(self, timeout: float, accel_limit: float) -> None:
        """Set the time-out [s] and `accel_limit`, in m/s^2 by name only (see the class)."""
        self._timeout = round(1e9 * timeout)
        self._step = int(accel_limit * self._ticks_meter / self._rate)

    def reset(self, now: int) -> None:
        """Begin at a time [ns], at rest."""
        self.setpoints = (0, 0)
        self.x = self.y = self.yaw = 0.0
        self.linear = self.angular = 0.0
        self._wanted = (0, 0)
        self._commanded_at = self._updated_at = now
        self._next = now + self._period
        self._ticks: tuple[int, int] | None = None

    def command(self, linear: float, angular: float, now: int) -> None:
        """Take a velocity [m/s], [rad/s] at a time [ns]."""
        self._commanded_at = now
        self._wanted = setpoints_of(linear, angular, self._base_width, self._ticks_meter)

    @property
    def timed_out(self) -> bool:
        """Whether the last update found no command young enough; a time-out of 0 never comes."""
        return 0 < self._timeout < self._updated_at - self._commanded_at

    def update(self, now: int, left: int, right: int) -> bool:
        """Do what is due at a time [ns] with encoders at these ticks; return whether it was."""
        if now <= self._next:
            return False
        elapsed, self._updated_at = 1e-9 * (now - self._updated_at), now
        self._count(left, right, elapsed)
        if self.timed_out:
            self._wanted = (0, 0)
        self.setpoints = (
            self._ramp(self.setpoints[0], self._wanted[0]),
            self._ramp(self.setpoints[1], self._wanted[1]),
        )
        self._next = now + self._period
        return True

    def _count(self, left: int, right: int, elapsed: float) -> None:
        before, self._ticks = self._ticks or (left, right), (left, right)
        paths = [(b - a) / self._ticks_meter for a, b in zip(before, self._ticks, strict=True)]
        path = (paths[0] + paths[1]) / 2
        turn = (paths[1] - paths[0]) / self._base_width
        self.linear, self.angular = path / elapsed, turn / elapsed
        ahead, aside = math.cos(turn) * path, -math.sin(turn) * path
        self.x += math.cos(self.yaw) * ahead - math.sin(self.yaw) * aside
        self.y += math.sin(self.yaw) * ahead + math.cos(self.yaw) * aside
        self.yaw += turn

    def _ramp(self, setpoint: int, wanted: int) -> int:
        if setpoint < wanted:
            return min(setpoint + self._step, wanted)
        return max(setpoint - self._step, wanted)


def setpoints_of(
    linear: float, angular: float, base_width: float, ticks_meter: float
) -> tuple[int, int]:
    """
    Return what arbotix makes of a velocity [m/s], [rad/s]: whole ticks per 1/30 s.

    The board has 16 bits for them; what is beyond is the most that they hold.
    """
    half = angular * base_width / 2.0
    left, right = (
        int(max(-MOST_TICKS, min(speed * ticks_meter / FRAMES_PER_SECOND, MOST_TICKS)))
        for speed in (linear - half, linear + half)
    )
    return left, right


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
        """Forget the command: the robot stops on arbotix's ramp."""
        self._has_command = False
        self._new_age = None
        self.host.command(0.0, 0.0, self._now)

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
            self.host.update(
                self._now,
                count_ticks(left, self._scale),
                count_ticks(right, self._scale),
            )
        return self._wheel_speeds()

    def _wheel_speeds(self) -> tuple[float, float]:
        left, right = self.host.setpoints
        speed = FRAMES_PER_SECOND / self._scale  # of one tick per frame [rad/s]
        return left * speed, right * speed
