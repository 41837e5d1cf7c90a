# SPDX-License-Identifier: Apache-2.0
"""Gait clock: which foot stands when. It runs on the time it is given, on no other clock."""

import math
from typing import NamedTuple

import numpy as np

from quadruped_sim.presets import GaitRow, GAITS
from quadruped_sim.tuning import GaitParameters

# How fast a gait becomes another while the legs move: shares of a period, and of each of the
# row's other numbers, per second.
_GLIDE = 0.6
# A robot that haste makes so much faster, on the Go2 [m/s], was pushed: it steps as in a trot,
# whose feet stand widest, and comes to that so fast, in the same shares.
_PUSHED, _CATCH = 1.0, 2.0
# How far the share of the period that feet stand follows haste. A pushed robot steps quickly but
# must be carried: with the flight phases of a fast trot, one that is loaded sinks to its knees.
_LIGHTNESS = 0.5
_DUTY_MAX = 0.95


class GaitState(NamedTuple):
    """
    Schedule of this moment, legs in `LEGS` order.

    `is_stance` (4,) bool; `phase` (4,) in [0, 1) is the progress of the present stance or swing;
    `stance_time` and `swing_time` [s] are their full durations; `pace` in [0, 1] is where between
    the slow gait and the fast one they are. `footprint` is the length and width between the
    feet as shares of those between the hips.
    """

    is_stance: np.ndarray
    phase: np.ndarray
    stance_time: float
    swing_time: float
    pace: float
    footprint: tuple[float, float] = (1.0, 1.0)


class Gait:
    """
    Gait whose period and duty follow the speed; stands still when it may.

    State: one phase in [0, 1) for all legs, whether the legs move, the offsets and shape of their
    steps on the way to those of the chosen gait, and the speed that pushes of late count as.
    `step(dt, ...)` advances it.
    """

    def __init__(
        self,
        params: GaitParameters,
        speed: float = 1.0,
        slimness: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """
        Take a robot whose speeds are those of a Go2 times `speed`.

        `slimness` is a Go2's footprint, length and width, over its own; at most 1.
        """
        self._pushed = _PUSHED * speed
        self._slimness = slimness
        self.tune(params)
        self.reset()

    def tune(self, params: GaitParameters) -> None:
        """Take other parameters, from the next step."""
        self.params = params
        self._followed: tuple[float, float, bool, GaitRow] | None = None
        self._resting: GaitState | None = None  # the schedule of legs that rest, once it is asked

    def reset(self) -> None:
        """Stand on four feet; the first step of a trot will lift FR and RL."""
        self._phase = 0.0
        self.is_stepping = False
        self._haste = 0.0
        self._offsets, self._shape = np.zeros(4), np.zeros(4)
        self._reached: GaitRow | None = None
        self._toward = GAITS[self.params.name]
        self._glide(self._toward, math.inf)
        self._follow(0.0, 0.0, wants_steps=False)

    def start(self) -> None:
        """Step at a trot from now on, whatever gait is chosen; first FR and RL lift."""
        self._toward = GAITS['trot']
        self._glide(self._toward, math.inf)
        self.is_stepping, self._phase = True, 0.0

    @property
    def has_changed(self) -> bool:
        """Whether legs that move do so in the chosen gait, those that rest in any."""
        return not self.is_stepping or self._reached is GAITS[self.params.name]

    def step(
        self,
        dt: float,
        speed: float,
        wants_steps: bool,
        error: float = 0.0,
        *,
        is_ending: bool = False,
    ) -> GaitState:
        """
        Schedule after `dt` [s] at commanded `speed` [m/s].

        A velocity that is off by `error` [m/s] hastens it: quick steps catch a pushed robot where
        far ones cannot [Khadiv2020]. Without `wants_steps` the legs keep moving until all four
        stand, then rest there. A walk `is_ending` at a trot, whose feet stand widest.
        """
        params = self.params
        pushed = params.haste_gain * (error - params.haste_error)
        self._haste = max(self._haste - params.haste_decay * dt, pushed, 0.0)
        is_pushed = self._haste > self._pushed
        row = self._next(GAITS['trot' if is_ending or is_pushed else params.name])
        glide = _CATCH if is_pushed else _GLIDE
        self._glide(row, glide * dt if self.is_stepping else math.inf)
        self._follow(speed, max(self._haste - speed, 0.0), wants_steps)
        if wants_steps and not self.is_stepping:
            self.is_stepping = True
            self._phase = 0.0
        elif self.is_stepping:
            self._phase = (self._phase + dt / self._period) % 1.0
            if not wants_steps and max(self._leg_phases()) < self._duty:
                self.is_stepping = False
        return self.state()

    def _next(self, row: GaitRow) -> GaitRow:
        """
        Return the gait to glide into on the way to another: legs that move go through a trot.

        What lies between two others, such as between a walk and a pace, does not carry a robot.
        """
        trot = GAITS['trot']
        if row is not self._toward:
            is_direct = not self.is_stepping or self._reached is trot
            self._toward = row if is_direct else trot
        return self._toward

    def _glide(self, row: GaitRow, most: float) -> None:
        """Move the present offsets and shape toward a gait's, by at most `most`."""
        if row is self._reached:
            return
        offsets = np.array(row.offsets)
        slim = [own if slim else 1.0 for own, slim in zip(self._slimness, row.slim, strict=True)]
        footprint = np.multiply(row.footprint, slim)
        shape = np.array((row.period, row.longer, *footprint))
        around = (offsets - self._offsets + 0.5) % 1.0 - 0.5
        change = np.concatenate((around, shape - self._shape))
        if np.abs(change).max() <= most:
            self._offsets, self._shape, self._reached = offsets, shape, row
            return
        step = np.clip(change, -most, most)
        self._offsets, self._shape = self._offsets + step[:4], self._shape + step[4:]
        self._reached = None

    def _pace_of(self, speed: float) -> float:
        span = max(self.params.fast_speed - self.params.slow_speed, 1e-6)
        return min(max((speed - self.params.slow_speed) / span, 0.0), 1.0)

    def _follow(self, speed: float, more: float, wants_steps: bool) -> None:
        """Take period and duty of a speed, and of as much `more` as haste is beyond it [m/s]."""
        reached = self._reached
        asked = None if reached is None else (speed, more, wants_steps, reached)
        if asked is not None and asked == self._followed:
            return  # as in the tick before
        self._followed, self._resting = asked, None
        params = self.params
        self._pace = share = self._pace_of(speed + more)
        period, longer, *footprint = self._shape.tolist()
        self._footprint = footprint[0], footprint[1]
        self._period = period * (
            params.slow_period + share * (params.fast_period - params.slow_period)
        )
        calm = self._pace_of(speed)
        share = calm + _LIGHTNESS * (share - calm)
        duty = params.slow_duty + share * (params.fast_duty - params.slow_duty)
        # A robot that is to stop on four feet needs a moment in which all of them stand.
        least = 0.0 if wants_steps else duty_to_rest(self._offsets)
        self._duty = min(max(duty + longer, least), _DUTY_MAX)

    def _leg_phases(self) -> list[float]:
        # In plain numbers: numpy takes ten times as long for four of them.
        return [(self._phase + offset) % 1.0 for offset in self._offsets.tolist()]

    def state(self) -> GaitState:
        """Schedule now."""
        stance_time = self._duty * self._period
        rest = stance_time, self._period - stance_time, self._pace, self._footprint
        if not self.is_stepping:
            if self._resting is None:
                self._resting = GaitState(np.ones(4, dtype=bool), np.full(4, 0.5), *rest)
            return self._resting
        legs, duty = self._leg_phases(), self._duty
        phase = [leg / duty if leg < duty else (leg - duty) / (1.0 - duty) for leg in legs]
        return GaitState(np.array([leg < duty for leg in legs]), np.array(phase), *rest)

    def forecast(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """
        Schedule at `times` (n,) [s] from now: stance flags and stance phase, both (n, 4).

        The phase is only meaningful where the flag is true.
        """
        if not self.is_stepping:
            shape = (len(times), 4)
            return np.ones(shape, dtype=bool), np.full(shape, 0.5)
        legs = (self._phase + times[:, None] / self._period + self._offsets) % 1.0
        return legs < self._duty, legs / self._duty


def duty_to_rest(offsets: np.ndarray) -> float:
    """Share of the period that feet must stand to stand all at once, for 1/50 of a period."""
    starts = np.sort(offsets % 1.0)
    return 1.02 - float(np.diff(starts, append=starts[0] + 1.0).max())
