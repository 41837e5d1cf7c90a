# SPDX-License-Identifier: Apache-2.0
"""The friction that the feet find, by how they slip."""

import math

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import cross3, rotate, rotate_back

# Cosine between motion and force of a foot below which it slips: -1, but for what is not known.
_OPPOSED = -0.9


class Grip:
    """
    Friction coefficient that forces may use: a guess at first, then what is felt.

    A foot that slips feels the coefficient itself, as the ratio of its tangential to its normal
    force, and is not to be asked for more [Focchi2018]; one that bears as much as is believed in
    without slipping says that there is more. Friction opposes what slips: a foot that moves
    otherwise is only landing. State: that coefficient.
    """

    def __init__(self, guess: float) -> None:
        self.guess, self.flat = guess, np.empty(1)
        self.reset()

    def reset(self) -> None:
        """Believe the guess."""
        self.friction = self.guess

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
        return min(1.0, self.friction / self.guess)


@jit
def feel_grip(
    robot: np.ndarray,
    stands: np.ndarray,
    frame: np.ndarray,
    own: np.ndarray,
    rules: np.ndarray,
    dt: float,
) -> None:
    """
    Advance the coefficient `own` (1,) by a tick with the feet of the mask `stands` (4,).

    These bear load. `frame` (3, 3) turns ground axes, whose z is the normal, into the world.
    """
    rule, guess = rules[0].grip, rules[0].mpc.friction
    slips, used = _feel(robot, stands, frame, rule.slip_speed)
    friction = own[0]
    if slips < math.inf:
        fall = min(1.0, dt / rule.fall_time)
        friction += fall * min(rule.share * slips - friction, 0.0)
    elif used > rule.share * friction:
        friction += dt * rule.rise
    # A guess beyond the bounds widens them: somebody knows better.
    own[0] = min(max(min(rule.least, guess), friction), max(rule.most, guess))


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
