# SPDX-License-Identifier: Apache-2.0
"""The friction that the feet find, by how they slip."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import cross3, rotate, rotate_back
from quadruped_sim.tuning import GripParameters

# Cosine between motion and force of a foot below which it slips: -1, but for what is not known.
_OPPOSED = -0.9


class GripRule(NamedTuple):
    """See `GripParameters`; the share of a tick to fall by, how far it rises, and its ends."""

    slip_speed: float
    share: float
    fall: float
    rise: float
    least: float
    most: float


class Grip:
    """
    Friction coefficient that forces may use: a guess at first, then what is felt.

    A foot that slips feels the coefficient itself, as the ratio of its tangential to its normal
    force, and is not to be asked for more [Focchi2018]; one that bears as much as is believed in
    without slipping says that there is more. Friction opposes what slips: a foot that moves
    otherwise is only landing. State: that coefficient.
    """

    def __init__(self, params: GripParameters, guess: float) -> None:
        self.flat = np.empty(1)
        self.tune(params, guess)
        self.reset()

    def tune(self, params: GripParameters, guess: float) -> None:
        """Take other parameters and another guess."""
        self._params, self._guess = params, guess
        # A guess beyond what is believed in is what somebody knows better.
        self._least, self._most = min(params.least, guess), max(params.most, guess)

    def reset(self) -> None:
        """Believe the guess."""
        self.friction = self._guess

    @property
    def friction(self) -> float:
        """The coefficient."""
        return float(self.flat[0])

    @friction.setter
    def friction(self, friction: float) -> None:
        self.flat[0] = friction

    @property
    def share(self) -> float:
        """Share of the guess that is there, at most 1: what speeding up must keep to."""
        return min(1.0, self.friction / self._guess)

    def rule(self, dt: float) -> GripRule:
        """Return how friction is felt in ticks of `dt` [s]."""
        params = self._params
        fall, rise = min(1.0, dt / params.fall_time), dt * params.rise
        return GripRule(params.slip_speed, params.share, fall, rise, self._least, self._most)


@jit
def feel_grip(
    robot: np.ndarray, stands: np.ndarray, frame: np.ndarray, own: np.ndarray, rule: GripRule
) -> None:
    """
    Advance the coefficient `own` (1,) by a tick with the feet of the mask `stands` (4,).

    These bear load. `frame` (3, 3) turns ground axes, whose z is the normal, into the world.
    """
    slips, used = _feel(robot, stands, frame, rule.slip_speed)
    friction = own[0]
    if slips < math.inf:
        friction += rule.fall * min(rule.share * slips - friction, 0.0)
    elif used > rule.share * friction:
        friction += rule.rise
    own[0] = min(max(rule.least, friction), rule.most)


@jit
def _feel(
    robot: np.ndarray, stands: np.ndarray, frame: np.ndarray, slip_speed: float
) -> tuple[float, float]:
    """Least ratio of tangential to normal force on feet that slip, and the largest on any."""
    state = robot[0]
    base, contact = state.base, state.contact
    slips, used, relative = math.inf, 0.0, np.empty(3)
    for i in range(4):
        if not stands[i]:
            continue
        turned = cross3(base.omega, contact.position[i])
        swept = rotate(contact.jacobian[i], state.joint_velocity[3 * i : 3 * i + 3])
        for k in range(3):
            relative[k] = turned[k] + swept[k]
        slides = rotate(base.R, relative)
        for k in range(3):
            relative[k] = slides[k] + base.velocity[k]
        moves = rotate_back(frame, relative)
        force = rotate_back(frame, rotate(base.R, state.forces[i]))
        ratio = math.hypot(force[0], force[1]) / max(force[2], 1e-6)
        speed = math.hypot(moves[0], moves[1])
        power = force[0] * moves[0] + force[1] * moves[1]
        if speed > slip_speed and power < _OPPOSED * speed * ratio * force[2]:
            slips = min(slips, ratio)
        used = max(used, ratio)
    return slips, used
