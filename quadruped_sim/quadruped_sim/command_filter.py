# SPDX-License-Identifier: Apache-2.0
"""Makes a velocity command feasible: clamp, ramp, watchdog, no NaN."""

from collections.abc import Callable, Sequence
import math
from operator import mul

import numpy as np
from robot_description.morphology.quadruped import GO2, Scale
from wasd_core.timing import Watchdog

from quadruped_sim.presets import GAITS, LIMITS, VelocityLimits
from quadruped_sim.tuning import CommandParameters

# A command so close to its bounds is within them [m/s], [rad/s].
_CLOSE = 0.02
# Share of what two gaits can do at which one becomes the other.
_CROSSING = 0.6


def velocity_limits(
    name: str, scale: Scale, agility: float = 1.0, turning: float = 1.0, gait: str = 'trot'
) -> VelocityLimits:
    """
    Return the limits of a robot in a gait: they grow with it, only `guide` is the same for all.

    `agility` is the share of that which its legs are fast enough for, `turning` the share of that
    when it turns; no robot is asked for more than its gait allows.
    """
    speed, turn = _units(scale, agility, turning)
    unit = VelocityLimits(speed, speed, speed, turn)
    able = LIMITS['race' if name == 'race' else 'sport']
    grown = VelocityLimits(*map(mul, map(min, able, GAITS[gait].limits), unit))
    return VelocityLimits(*map(min, LIMITS['guide'], grown)) if name == 'guide' else grown


def _units(scale: Scale, agility: float, turning: float) -> tuple[float, float]:
    """Return a robot's speed [m/s] and yaw rate [rad/s] where a Go2's are 1."""
    return agility * scale.of('m/s'), agility * turning * scale.of('1/s')


class CommandFilter:
    """
    Turns (vx, vy, yaw rate) requests into a command that ramps within limits.

    State: the request, its age and the present command. One `step` ages the request and moves the
    command; a request older than `timeout` counts as zero. `grip` in (0, 1] slows the ramps on
    slippery ground, and no command is faster than `most`. A robot whose `velocity()` (2,), ahead
    and to the left [m/s], is far behind would catch up with all the friction there is: its command
    waits, unless it slows down.
    """

    def __init__(
        self,
        params: CommandParameters,
        scale: Scale = GO2,
        agility: float = 1.0,
        turning: float = 1.0,
        gait: str = 'trot',
    ) -> None:
        self._robot = scale, agility, turning
        # What a guard leaves of the request in force, shape (3,).
        self.hold_back: Callable[[np.ndarray], np.ndarray] = lambda velocity: velocity
        self._age = Watchdog(params.timeout)
        self._request = np.zeros(3)
        self.tune(params, gait)
        self.reset()

    def tune(
        self, params: CommandParameters, gait: str = 'trot', stepped: str | None = None
    ) -> None:
        """
        Take other limits, ramps and time-out; they hold for the present request, too.

        Limits are those of the `gait` that is chosen. On the way to it from another the command
        stays within a share of what either can do; ramps are those of the gait that is `stepped`.
        """
        self._params = params
        self.limits = velocity_limits(params.limits, *self._robot, gait)
        self._leash = params.leash * self._robot[0].of('m/s')
        stepped = stepped or gait
        bounds = [self._bounds(name) for name in {gait, stepped}]
        share = 1.0 if stepped == gait else _CROSSING
        self._limits, self._able = (
            (share * np.min(part, axis=0)).tolist() for part in zip(*bounds, strict=True)
        )
        ramps = params.forward_acceleration, params.lateral_acceleration, params.yaw_acceleration
        self._acceleration = [GAITS[stepped].agility * ramp for ramp in ramps]
        self._age.timeout = params.timeout
        self._request = self._clamped(*self._request.tolist())
        self._asked: tuple[float, float, float] | None = None  # what the request was clamped from

    def _bounds(self, gait: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the limits (4,) in a gait and the half axes (3,) of its ellipsoid."""
        speed, turn = _units(*self._robot)
        able = np.array(GAITS[gait].able) * (speed, speed, turn)
        return np.array(velocity_limits(self._params.limits, *self._robot, gait)), able

    def reset(self) -> None:
        """Rest, as if no request had ever come."""
        self._request, self._asked = np.zeros(3), None
        self.command = np.zeros(3)
        self.grip = 1.0
        self.most = math.inf  # the speed that the ground ahead allows [m/s]
        # Asked only when the command has to change; not known: it waits for nobody.
        self.velocity: Callable[[], np.ndarray] | None = None
        self.forget_request()

    def forget_request(self) -> None:
        """Forget the request: the command ramps down to rest."""
        self._age.reset()
        self._is_new = False

    def pass_time(self, dt: float) -> None:
        """Let `dt` [s] pass in which nothing was controlled: the request alone gets older."""
        if not self._is_new:
            self._age.step(dt)

    @property
    def is_within(self) -> bool:
        """Whether the present command has come within its bounds."""
        command = self.command.tolist()
        return bool(np.allclose(self._clamped(*command), command, rtol=0.0, atol=_CLOSE))

    @property
    def is_silent(self) -> bool:
        """Whether the watchdog holds the command at zero."""
        return not self._age.is_alive

    def request(self, vx: float, vy: float, yaw_rate: float) -> str | None:
        """Take a request, clamped; NaN or infinity is refused, which the returned text says."""
        if not (math.isfinite(vx) and math.isfinite(vy) and math.isfinite(yaw_rate)):
            return f'velocity command refused: not finite: ({vx}, {vy}, {yaw_rate})'
        if (vx, vy, yaw_rate) != self._asked:  # sticks ask for the same again and again
            self._request, self._asked = self._clamped(vx, vy, yaw_rate), (vx, vy, yaw_rate)
        self._age.hear()
        self._is_new = True
        return None

    def _clamped(self, vx: float, vy: float, yaw_rate: float) -> np.ndarray:
        """Return a velocity within the limits that leads along the same curve as far as it can."""
        # In plain numbers: numpy takes ten times as long for three of them.
        forward, backward, lateral, yaw = self._limits
        vx = min(max(vx, -backward), forward)
        vy = min(max(vy, -lateral), lateral)
        yaw_rate = min(max(yaw_rate, -yaw), yaw)
        # Full speed ahead leaves the feet no time to go sideways or around as well.
        ahead, left, turn = self._able
        share = (vx / ahead) ** 2 + (vy / left) ** 2 + (yaw_rate / turn) ** 2
        over = max(math.sqrt(share), 1.0)
        vx, vy, yaw_rate = vx / over, vy / over, yaw_rate / over
        inward = math.hypot(vx, vy) * abs(yaw_rate)
        most = self._params.curve_acceleration
        slower = 1.0 if inward <= most else math.sqrt(most / inward)
        return np.array((slower * vx, slower * vy, slower * yaw_rate))

    def step(self, dt: float, *, may_go: bool = True) -> np.ndarray:
        """
        Command (3,) after `dt` [s]: toward the request, or toward rest when it is too old.

        Who may not go yet is commanded to rest; the request stays, and gets older.
        """
        self.pass_time(dt)
        self._is_new = False
        goes = may_go and not self.is_silent
        target = self.hold_back(self._request).tolist() if goes else (0.0, 0.0, 0.0)
        if (speed := math.hypot(target[0], target[1])) > self.most:
            target = [part * self.most / speed for part in target]
        slow = self.grip * dt
        plane = slow * self._share(target)
        vx, vy, turn = map(
            _approach,
            self.command.tolist(),
            target,
            self._acceleration,
            (plane, plane, slow),
        )
        # On its way from one curve to another the yaw rate waits for the speed.
        tightest = self.grip * self._params.curve_acceleration / max(math.hypot(vx, vy), 1e-9)
        self.command = np.array((vx, vy, min(max(turn, -tightest), tightest)))
        return self.command

    def _share(self, target: Sequence[float]) -> float:
        """Share in [0, 1] of its ramp that a command takes toward a target."""
        if self.velocity is None:
            return 1.0
        vx, vy, _ = self.command.tolist()
        more_x, more_y = target[0] - vx, target[1] - vy
        # Nobody has to wait to go on as before, or slower.
        if more_x == more_y == 0.0 or vx * more_x + vy * more_y < 0.0:
            return 1.0
        x, y = self.velocity().tolist()
        ahead, left = vx - x, vy - y
        if not ahead * more_x + left * more_y > 0.0:  # it is not behind
            return 1.0
        return min(max(2.0 - math.hypot(ahead, left) / self._leash, 0.0), 1.0)


def _approach(now: float, wanted: float, acceleration: float, time: float) -> float:
    """Move toward what is wanted for a time."""
    most = time * acceleration
    ahead = wanted - now
    return now + (most if ahead > most else max(ahead, -most))
