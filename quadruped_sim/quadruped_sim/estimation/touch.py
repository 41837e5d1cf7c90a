# SPDX-License-Identifier: Apache-2.0
"""Which feet touch, by joint torques alone."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, solve_in_place, Three, view_of


class Felt(NamedTuple):
    """
    State of the momentum observer, both (12,): its integral and J'f as far as it is seen.

    From it follow the feet's forces (4, 3) [N], their loads (4,) [N] and which touch (4,).
    The first step, before it `is_started`, takes the present momentum for all that is known.
    """

    integral: np.ndarray
    residual: np.ndarray
    forces: np.ndarray
    normal_forces: np.ndarray
    is_contact: np.ndarray
    is_started: np.ndarray


class ContactDetector:
    """
    Estimates the force on each foot and whether it touches.

    The joint momentum p obeys dp/dt = tau + C'v - g + J'f. A residual driven by the part of p that
    the known terms do not explain is J'f low-passed at `bandwidth` [DeLuca2006].
    State: the observer, the forces (4, 3) [N] in base axes, contact flags with hysteresis.
    """

    def __init__(self) -> None:
        flags, flag = np.zeros(4, dtype=bool), np.zeros(1, dtype=bool)
        blank = Felt(np.zeros(12), np.zeros(12), np.zeros((4, 3)), np.zeros(4), flags, flag)
        self.flat = flatten(blank)
        self._felt: Felt = view_of(self.flat, blank)
        self.forces, self.normal_forces = self._felt.forces, self._felt.normal_forces
        self.is_contact = self._felt.is_contact
        self.reset()

    def reset(self) -> None:
        """Forget the past; the next step starts from zero force."""
        for part in self._felt:
            part[:] = 0


@jit
def feel_touch(
    flat_felt: np.ndarray, robot: np.ndarray, torque: np.ndarray, rules: np.ndarray, dt: float
) -> None:
    """
    Advance a flat `Felt` by the joints' torques (12,) [N m] in a flat `RobotState`.

    What feet bear is left to be found: see `find_touch`.
    """
    felt, state = flat_felt[0], robot[0]
    integral, residual, forces = felt.integral, felt.residual, felt.forces
    drift, momentum = state.dynamics.momentum_drift, state.dynamics.momentum
    # Faster than the steps the observer would swing, and from twice that on without end.
    rate = min(rules[0].contact.bandwidth, 1.0 / max(dt, 1e-9))
    for k in range(12):
        if not felt.is_started[0]:
            integral[k] = momentum[k]
        integral[k] += dt * (torque[k] + drift[k] + residual[k])
        residual[k] = rate * (momentum[k] - integral[k])
    felt.is_started[0] = True
    damped, pull = np.empty((3, 3)), np.empty((3, 1))
    for i in range(4):
        J = state.motion.jacobian[i]
        # On a nearly straight leg J is nearly singular along the leg; the pull stays bounded.
        for row in range(3):
            pull[row, 0] = 0.0
            for k in range(3):
                pull[row, 0] += J[row, k] * residual[3 * i + k]
                damped[row, k] = 1e-5 if row == k else 0.0
                for m in range(3):
                    damped[row, k] += J[row, m] * J[k, m]
        solve_in_place(damped, pull)
        for k in range(3):
            forces[i, k] = pull[k, 0]


@jit
def find_touch(flat_felt: np.ndarray, normal: Three, rules: np.ndarray) -> None:
    """Write what the feet bear and which touch, with `normal` up in base axes."""
    felt, rule = flat_felt[0], rules[0].contact
    for i in range(4):
        bears = 0.0
        for k in range(3):
            bears += felt.forces[i, k] * normal[k]
        felt.normal_forces[i] = bears
        felt.is_contact[i] = bears > (rule.force_off if felt.is_contact[i] else rule.force_on)
