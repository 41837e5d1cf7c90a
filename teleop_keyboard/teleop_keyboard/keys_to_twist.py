# SPDX-License-Identifier: Apache-2.0
"""Turns keys into a ramped velocity command; the caller gives the time."""

from dataclasses import dataclass
import math
from typing import NamedTuple

from wasd_core.parameters import InvalidParameter
from wasd_core.timing import HELD, split_event, STOP_KEY

from teleop_keyboard.hold import Motion, NOWHERE
from teleop_keyboard.keymap import Keymap, Limits
from teleop_keyboard.parameters import AS_PRESET, SPEED_NAMES, TeleopParameters, TURN_NAMES

# Closer than this a ramp has arrived; rounding must not cost another step [m/s or rad/s].
ARRIVED = 1e-12


class Velocity(NamedTuple):
    """In the robot's frame: forward, left and up [m/s], counter-clockwise [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wz: float = 0.0


STANDSTILL = Velocity()


def ramped_velocity(previous: float, target: float, acceleration: float, dt: float) -> float:
    """
    Velocity reachable from `previous` in `dt` [s], moving toward `target`.

    `acceleration` is a magnitude and holds for speeding up and for braking: a command that was
    held for T covers target * T, however long its ramps are. A `dt` of 0 returns `previous`.
    """
    step = acceleration * dt
    error = abs(target - previous)
    if error < step or error - step < ARRIVED:
        return target
    return previous + step if target > previous else previous - step


@dataclass(frozen=True, kw_only=True)
class Pace:
    """How fast the axes may change [m/s^2], [rad/s^2]: away from zero, toward it, to a stop."""

    linear_accel: float
    angular_accel: float
    linear_decel: float
    angular_decel: float
    linear_stop: float
    angular_stop: float
    keep_direction: bool = False


def ramped_twist(previous: Velocity, target: Velocity, pace: Pace, dt: float) -> Velocity:
    """
    Return the velocity reachable from `previous` in `dt` [s], moving toward `target`.

    Each axis has its own ramp; with `keep_direction` all arrive together with the slowest. A
    reversal brakes to zero first, at the pace of braking.
    """
    is_stop = target == STANDSTILL
    linear = pace.linear_accel, pace.linear_stop if is_stop else pace.linear_decel
    angular = pace.angular_accel, pace.angular_stop if is_stop else pace.angular_decel
    limits = linear, linear, linear, angular
    axes = [
        _axis(before, after, accel, decel, dt)
        for before, after, (accel, decel) in zip(previous, target, limits, strict=True)
    ]
    if not pace.keep_direction:
        return Velocity(*axes)
    # The share of its way that an axis covers; the smallest holds for all.
    ways = zip(previous, target, axes, strict=True)
    share = min(
        (
            (reached - before) / (after - before)
            for before, after, reached in ways
            if after != before
        ),
        default=1.0,
    )
    if share >= 1.0 - ARRIVED:
        return target
    return Velocity(*(b + share * (a - b) for b, a in zip(previous, target, strict=True)))


def _axis(previous: float, target: float, accel: float, decel: float, dt: float) -> float:
    """Ramp one axis, which brakes while it moves toward zero."""
    if accel == decel or previous * target > 0.0 and abs(target) > abs(previous):
        return ramped_velocity(previous, target, accel, dt)
    if previous == 0.0 or decel <= 0.0:
        return ramped_velocity(previous, target, accel, dt)
    floor = target if previous * target > 0.0 else 0.0
    reached = ramped_velocity(previous, floor, decel, dt)
    left = dt - abs(previous - reached) / decel
    if reached != floor or left <= 0.0 or floor == target:
        return reached
    return ramped_velocity(floor, target, accel, left)


# A longer pause than this was no driving time: the process slept, or the clock jumped [s].
LONGEST_STEP = 0.2


class KeysToTwist:
    """
    The meaning of a sequence of keys as a velocity command.

    It keeps which keys are held or latched, the speeds that the speed keys have set, and the
    velocity commanded now. `press` tells a key, `step` lets time pass and returns the command that
    is to be published then, or None. Nothing here looks at a clock.

    Raises:
        InvalidParameter: when `parameters` do not fit each other or the keymap's limits.
    """

    def __init__(self, keymap: Keymap, parameters: TeleopParameters | None = None) -> None:
        self.keymap = keymap
        self._parameters = TeleopParameters()
        self.speed = keymap.speed  # full, as set by parameters and speed keys [m/s]
        self.turn = keymap.turn  # [rad/s]
        self.motion = Motion(keymap.motion, keymap.mode, self._parameters.step_share)
        self.last_key = ''
        self.velocity = STANDSTILL
        self._is_silent = False
        self._since_publish = 0.0
        self.set_parameters(parameters or TeleopParameters())
        self.reset()

    @property
    def rate(self) -> float:
        """How often a moving robot gets a command [Hz]."""
        return self._parameters.rate or self.keymap.rate

    @property
    def target(self) -> Velocity:
        """The velocity that the ramp moves toward."""
        direction = self.motion.direction
        x, y, z = (share * self.speed for share in direction[:3])
        return Velocity(x, y, z, direction.yaw * self.turn)

    @property
    def is_moving(self) -> bool:
        """Whether the command is not, or will not stay, zero."""
        return self.velocity != STANDSTILL or self.target != STANDSTILL

    @property
    def is_silent(self) -> bool:
        """
        Whether nothing will change and nothing be published until a key is pressed.

        Keys that are down and cancel each other are no silence: one will be released first.
        """
        return self._is_silent and not self.is_moving and self.motion.hold.is_idle

    def set_parameters(self, parameters: TeleopParameters) -> None:
        """
        Apply changed parameters; a full speed that did not change keeps what the keys made of it.

        Raises:
            InvalidParameter: when two names of one quantity disagree, or a limit is exceeded;
                nothing is changed then.
        """
        keymap = self.keymap
        speed = self._changed(parameters, SPEED_NAMES, keymap.speed, keymap.speed_limits)
        turn = self._changed(parameters, TURN_NAMES, keymap.turn, keymap.turn_limits)
        self.speed = self.speed if speed is None else speed
        self.turn = self.turn if turn is None else turn
        mode = keymap.mode if parameters.mode == AS_PRESET else parameters.mode
        if mode != self.motion.mode:
            self.motion.forget()
        self.motion.mode, self.motion.share = mode, parameters.step_share
        self.motion.hold.longest = parameters.key_timeout or math.inf
        self._parameters = parameters
        # What is not set follows from what is.
        linear = parameters.linear_accel or keymap.linear_accel
        angular = parameters.angular_accel or keymap.angular_accel
        linear_decel = parameters.linear_decel or linear
        angular_decel = parameters.angular_decel or angular
        self._pace = Pace(
            linear_accel=linear,
            angular_accel=angular,
            linear_decel=linear_decel,
            angular_decel=angular_decel,
            linear_stop=parameters.linear_stop or linear_decel,
            angular_stop=parameters.angular_stop or angular_decel,
            keep_direction=parameters.keep_direction,
        )

    def press(self, key: str) -> None:
        """
        Take one key message; speed keys and unknown keys never start a motion.

        HELD and RELEASE of a motion key say that it stays down, and that it does not.
        """
        event, key = split_event(key)
        if not key:
            return
        if event:
            (self.motion.keep_down if event == HELD else self.motion.release)(key)
            return
        keymap = self.keymap
        if keymap.first_character_only and key != STOP_KEY:
            key = key[0]
        self.last_key = key
        if key == STOP_KEY or key in keymap.stop_keys:
            self.stop()
        elif key in keymap.motion:
            self.motion.press(key)
        elif key in keymap.speed_keys:
            factor = keymap.speed_keys[key]
            self.speed = keymap.speed_limits.clamp(self.speed * factor.linear)
            self.turn = keymap.turn_limits.clamp(self.turn * factor.angular)
        elif keymap.other_keys == 'stop':
            self.motion.forget()

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion, at once or on the ramp."""
        if self.motion.mode != 'hold' and self.keymap.motion.get(key) == NOWHERE:
            return True
        return key == STOP_KEY or key in self.keymap.stop_keys

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""
        return key in self.keymap.motion and self.motion.mode != 'hold'

    def stop(self) -> None:
        """Stop without a ramp; the next `step` returns a zero, whatever the idle policy."""
        self.motion.stop()
        self.velocity = STANDSTILL
        self._is_silent = False
        self._since_publish = math.inf

    def reset(self) -> None:
        """Return to the state at the start: standing, full speeds as parameters say."""
        self.motion.forget()
        self.last_key = ''
        self.velocity = STANDSTILL
        self.speed = self._first_set(SPEED_NAMES) or self.keymap.speed
        self.turn = self._first_set(TURN_NAMES) or self.keymap.turn
        self._is_silent = self._idle != 'repeat'
        self._since_publish = math.inf

    def step(self, dt: float) -> Velocity | None:
        """
        Let `dt` [s] pass and return the command to publish at its end, None if there is none.

        A `dt` that is not a positive number lets no time pass. After a gap keys are as old as they
        are; the ramp alone goes on for no more than LONGEST_STEP.
        """
        dt = dt if math.isfinite(dt) and dt > 0.0 else 0.0
        self.motion.step(dt)
        dt = min(dt, LONGEST_STEP)
        self.velocity = ramped_twist(self.velocity, self.target, self._pace, dt)
        return self.velocity if self._is_due(dt) else None

    @property
    def _idle(self) -> str:
        idle = self._parameters.idle
        return self.keymap.idle if idle == AS_PRESET else idle

    def _is_due(self, dt: float) -> bool:
        """Tell whether a command is to be published now, `dt` after the step before."""
        self._since_publish += dt
        if self._idle == 'repeat' or (self._idle == 'zeros' and self.last_key):
            self._is_silent = False
        elif self._is_silent:
            if self.velocity == STANDSTILL:
                return False
            self._is_silent = False
            self._since_publish = math.inf
        elif not self.is_moving:
            # The one zero that ends a motion, at once.
            self._is_silent = True
            self._since_publish = math.inf
        period = 1.0 / self.rate
        # The step that is nearest to the due time: steps need not divide the period.
        if self._since_publish + 0.5 * dt < period - 1e-9:
            return False
        late = self._since_publish - period
        self._since_publish = late if late < period else 0.0
        return True

    def _changed(
        self, new: TeleopParameters, names: tuple[str, ...], default: float, limits: Limits
    ) -> float | None:
        """Return the value that a change gives one quantity, None if it is not concerned."""
        old = self._parameters
        changed = [name for name in names if getattr(new, name) != getattr(old, name)]
        if not changed:
            return None
        given = {name: getattr(new, name) for name in changed if getattr(new, name) > 0.0}
        if len(set(given.values())) > 1:
            text = ' and '.join(f'{name}={value:g}' for name, value in given.items())
            raise InvalidParameter(f'{text} name the same quantity, set one of them')
        # Set to 0 means back to the preset, or to another name that is still set.
        still = next((getattr(new, name) for name in names if getattr(new, name) > 0.0), default)
        value: float = next(iter(given.values()), still)
        if not limits.low <= value <= limits.high:
            raise InvalidParameter(
                f'{changed[0]} must be within {limits.low:g} .. {limits.high:g} '
                f'(preset {self.keymap.name}), got {value:g}'
            )
        return value

    def _first_set(self, names: tuple[str, ...]) -> float:
        """Return the value of the first name of a quantity that is set, else 0."""
        values = (getattr(self._parameters, name) for name in names)
        return next((value for value in values if value > 0.0), 0.0)
