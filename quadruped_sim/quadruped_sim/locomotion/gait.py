# SPDX-License-Identifier: Apache-2.0
"""Gait clock: which foot stands when. It runs on the time it is given, on no other clock."""

from typing import NamedTuple

import numpy as np

from quadruped_sim.parameters import DUTY_MAX
from quadruped_sim.parameters import GaitParameters
from quadruped_sim.parameters import GAITS


class GaitState(NamedTuple):
    """
    Schedule of this moment, legs in `LEGS` order.

    `is_stance` (4,) bool; `phase` (4,) in [0, 1) is the progress of the present stance or swing;
    `stance_time` and `swing_time` [s] are their full durations; `pace` in [0, 1] is where between
    the slow gait and the fast one they are.
    """

    is_stance: np.ndarray
    phase: np.ndarray
    stance_time: float
    swing_time: float
    pace: float


class Gait:
    """
    Gait whose period and duty follow the speed; stands still when it may.

    State: one phase in [0, 1) for all legs, whether the legs move, and the speed that pushes of
    late count as. `step(dt, ...)` advances it.
    """

    def __init__(self, params: GaitParameters) -> None:
        self.params = params
        self.reset()

    def reset(self) -> None:
        """Stand on four feet; the first step of a trot will lift FR and RL."""
        self._phase = 0.0
        self.is_stepping = False
        self._haste = 0.0
        self._follow(0.0, wants_steps=False)

    def step(self, dt: float, speed: float, wants_steps: bool, error: float = 0.0) -> GaitState:
        """
        Schedule after `dt` [s] at commanded `speed` [m/s].

        A velocity that is off by `error` [m/s] hastens it: quick steps catch a pushed robot where
        far ones cannot [Khadiv2020]. Without `wants_steps` the legs keep moving until all four
        stand, then rest there.
        """
        params = self.params
        pushed = params.haste_gain * (error - params.haste_error)
        self._haste = max(self._haste - params.haste_decay * dt, pushed, 0.0)
        self._follow(max(speed, self._haste), wants_steps)
        if wants_steps and not self.is_stepping:
            self.is_stepping = True
            self._phase = 0.0
        elif self.is_stepping:
            self._phase = (self._phase + dt / self._period) % 1.0
            if not wants_steps and bool(self._stance_at(self._phase).all()):
                self.is_stepping = False
        return self.state()

    def _follow(self, speed: float, wants_steps: bool) -> None:
        params = self.params
        span = max(params.fast_speed - params.slow_speed, 1e-6)
        self._pace = share = min(max((speed - params.slow_speed) / span, 0.0), 1.0)
        self._period = params.slow_period + share * (params.fast_period - params.slow_period)
        duty = params.slow_duty + share * (params.fast_duty - params.slow_duty)
        row = GAITS[params.name]
        # Who is to end on four feet needs a moment in which all stand.
        least = 0.0 if wants_steps else row.duty_to_rest
        self._duty = min(max(duty + row.longer, least), DUTY_MAX)
        self._offsets = np.array(row.offsets)

    def _leg_phases(self, phase: float) -> np.ndarray:
        return np.asarray((phase + self._offsets) % 1.0)

    def _stance_at(self, phase: float) -> np.ndarray:
        return self._leg_phases(phase) < self._duty

    def state(self) -> GaitState:
        """Schedule now."""
        stance_time = self._duty * self._period
        swing_time = self._period - stance_time
        if not self.is_stepping:
            rest = np.ones(4, dtype=bool), np.full(4, 0.5)
            return GaitState(*rest, stance_time, swing_time, self._pace)
        legs = self._leg_phases(self._phase)
        is_stance = legs < self._duty
        phase = np.where(is_stance, legs / self._duty, (legs - self._duty) / (1.0 - self._duty))
        return GaitState(is_stance, phase, stance_time, swing_time, self._pace)

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
