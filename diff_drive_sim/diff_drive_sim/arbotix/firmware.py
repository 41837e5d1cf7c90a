# SPDX-License-Identifier: Apache-2.0
"""The wheel loop of the ArbotiX board: integers only, as its firmware computes."""

from collections.abc import Callable
from dataclasses import dataclass
import math

from diff_drive_sim.geometry import Pair
from diff_drive_sim.wheel_loop import FULL_PWM
from diff_drive_sim.wheel_loop import Gains

# The board looks at its milliseconds and waits until more than so many have passed.
FRAME_MILLISECONDS = 33
# What the board believes a second has: set-points are ticks in one of these.
FRAMES_PER_SECOND = 30.0


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
