# SPDX-License-Identifier: Apache-2.0
"""The last half metre: straight to the goal, then around to its heading."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.planning.distances import Field
from wasd_navigation.planning.motion import Base, clearance, move
from wasd_navigation.se2 import wrap

GO, TURN, STAND = 0, 1, 2
# Shares of the tolerances: near enough to turn, to stand; and so far off that it goes again.
_NEAR, _TURNED, _OFF = 0.4, 0.3, 0.8
# What cannot go sideways goes ahead only when the goal is within this of straight ahead [rad].
_AHEAD = 0.3
# A base that cannot go sideways backs to a goal behind it that is nearer than this [m].
_BACK = 0.3
# Speed per distance, and yaw rate per angle [1/s], of a base without lag.
_GAIN = 1.5
# What is rehearsed before one docks: so many steps of so long [s].
_STEPS, _STEP = 150, 0.1
# A goal is reached when its error, over this time at rest [s], is within this share of tolerances.
_SETTLE, _REACHED = 0.5, 0.8


class Docking:
    """
    Drives straight to a goal (x, y, yaw), `tolerances` being of distance [m] and heading [rad].

    `is_going` is whether it goes there yet, not turns or stands, `is_there` whether it is there.
    """

    def __init__(self, goal: np.ndarray, base: Base, tolerances: tuple[float, float]) -> None:
        self.goal = goal
        self._base, self._tolerances = base, tolerances
        self._phase = GO
        self._errors: list[np.ndarray] = []
        self.is_there = False

    @property
    def is_going(self) -> bool:
        """Whether the goal is yet to be gone to."""
        return self._phase == GO

    def is_free(self, state: np.ndarray, around: tuple[Field, np.ndarray], margin: float) -> bool:
        """Whether nothing is in the way from a state (6,); see `rehearse`."""
        time = rehearse(state, self.goal, self._base, self._tolerances, around, margin)
        return bool(time < math.inf)

    def step(self, state: np.ndarray, dt: float) -> np.ndarray:
        """Return the velocity (3,) to ask for in a state (6,), `dt` [s] after the last step."""
        self._phase, *velocity = dock(state, self.goal, self._base, self._tolerances, self._phase)
        if self._phase != STAND:
            self._errors.clear()
            return np.array(velocity)
        error = self.goal - state[:3]
        self._errors.append(np.array((error[0], error[1], wrap(error[2]))))
        if len(self._errors) * dt >= _SETTLE:
            mean = np.mean(self._errors, axis=0)
            self._errors.clear()
            near, turned = (_REACHED * tolerance for tolerance in self._tolerances)
            self.is_there = bool(math.hypot(mean[0], mean[1]) <= near and abs(mean[2]) <= turned)
            if not self.is_there:
                self._phase = GO
        return np.zeros(3)


@jit
def dock(
    state: np.ndarray, goal: np.ndarray, base: Base, tolerances: tuple[float, float], phase: int
) -> tuple[int, float, float, float]:
    """
    Return the phase and the velocity (vx, vy, wz) [m/s, m/s, rad/s] toward a goal (x, y, yaw).

    `state` is (x, y, yaw, vx, vy, wz), `tolerances` are of distance [m] and heading [rad].
    """
    cos, sin = math.cos(state[2]), math.sin(state[2])
    ahead = cos * (goal[0] - state[0]) + sin * (goal[1] - state[1])
    left = cos * (goal[1] - state[1]) - sin * (goal[0] - state[0])
    distance = math.hypot(ahead, left)
    turn = wrap(goal[2] - state[2])
    gain = _GAIN / (1.0 + 2.0 * base.lag)
    if distance > _OFF * tolerances[0] or (phase == STAND and abs(turn) > _OFF * tolerances[1]):
        phase = GO
    if phase == GO and distance < _NEAR * tolerances[0]:
        phase = TURN
    if phase == TURN and abs(turn) < _TURNED * tolerances[1]:
        phase = STAND
    if phase == STAND:
        return phase, 0.0, 0.0, 0.0
    if base.is_omni:
        share = _share(base, gain * ahead, gain * left, gain * turn)
        return phase, share * gain * ahead, share * gain * left, share * gain * turn
    if phase == TURN:
        return phase, 0.0, 0.0, _within(gain * turn, base.most[2])
    bearing = math.atan2(left, ahead)
    sign = 1.0
    if distance < _BACK and abs(bearing) > 0.5 * math.pi:
        bearing, sign = wrap(bearing + math.pi), -1.0
    if abs(bearing) > _AHEAD:
        return phase, 0.0, 0.0, _within(2.0 * gain * bearing, base.most[2])
    speed = min(gain * distance, math.sqrt(base.change[0] * distance))
    speed = min(speed, base.most[0] if sign > 0.0 else -base.least[0])
    return phase, sign * speed, 0.0, _within(2.0 * gain * bearing, base.most[2])


@jit
def _within(value: float, most: float) -> float:
    bounded: float = min(max(value, -most), most)
    return bounded


@jit
def _share(base: Base, vx: float, vy: float, wz: float) -> float:
    """Return the largest share of a translation up to 1, and of a turn, that is within bounds."""
    over = max(abs(vx) / base.most[0], abs(vy) / base.most[1])
    over = max(max(over, abs(wz) / base.most[2]), vx / base.least[0])
    share: float = 1.0 / max(over, 1.0)
    return share


@jit
def rehearse(
    state: np.ndarray,
    goal: np.ndarray,
    base: Base,
    tolerances: tuple[float, float],
    around: tuple[Field, np.ndarray],
    margin: float,
) -> float:
    """
    Return how long docking from a state takes [s]; infinite when it comes near something.

    `around` are the distances and the circles of the footprint, `margin` [m] what is kept.
    """
    state = state.copy()
    velocity = np.zeros(3)
    phase = int(np.int64(GO))  # of a constant numba makes a type, and compiles `dock` twice
    for step in range(_STEPS):
        phase, velocity[0], velocity[1], velocity[2] = dock(state, goal, base, tolerances, phase)
        if phase == STAND:
            return step * _STEP
        move(state, velocity, base, _STEP)
        if clearance(around[0], around[1], state, margin) < margin:
            return math.inf
    return math.inf
