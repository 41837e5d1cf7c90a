# SPDX-License-Identifier: Apache-2.0
"""Which feet touch, from joint torques alone: a momentum observer and a threshold."""

import numpy as np

from quadruped_sim.jit import jit
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.parameters import ContactParameters
from quadruped_sim.robot_model import Dynamics
from quadruped_sim.small_matrix import solve_in_place


class ContactDetector:
    """
    Estimates the force on each foot and whether it touches.

    The joint momentum p obeys dp/dt = tau + C'v - g + J'f. A residual driven by the part of p that
    the known terms do not explain is J'f low-passed at `bandwidth` [DeLuca2006].
    State: the integral, the forces (4, 3) [N] in base axes, contact flags with hysteresis.
    """

    def __init__(self, params: ContactParameters) -> None:
        self.params = params
        self.reset()

    def reset(self) -> None:
        """Forget the past; the next step starts from zero force."""
        self._integral: np.ndarray | None = None
        self._residual = np.zeros(12)
        self.forces = np.zeros((4, 3))
        self.normal_forces = np.zeros(4)
        self.is_contact = np.zeros(4, dtype=bool)

    def step(
        self,
        torque: np.ndarray,
        motion: LegMotion,
        dynamics: Dynamics,
        normal: np.ndarray,
        dt: float,
    ) -> None:
        """Update by the measured joint `torque` (12,) [N m]; `normal` (3,) is up in base axes."""
        if self._integral is None:
            self._integral = dynamics.momentum.copy()
        self.forces = _observe(
            self._integral,
            self._residual,
            torque + dynamics.momentum_drift,
            dynamics.momentum,
            self.params.bandwidth,
            motion.jacobian,
            dt,
        )
        self.normal_forces = self.forces @ normal
        threshold = np.where(self.is_contact, self.params.force_off, self.params.force_on)
        self.is_contact = self.normal_forces > threshold


@jit
def _observe(
    integral: np.ndarray,
    residual: np.ndarray,
    known: np.ndarray,
    momentum: np.ndarray,
    bandwidth: float,
    jacobian: np.ndarray,
    dt: float,
) -> np.ndarray:
    """Advance `integral` and `residual` (12,) in place; returns the foot forces (4, 3) [N]."""
    for k in range(12):
        integral[k] += dt * (known[k] + residual[k])
        residual[k] = bandwidth * (momentum[k] - integral[k])
    forces = np.empty((4, 3))
    damped = np.empty((3, 3))
    pull = np.empty((3, 1))
    for i in range(4):
        J = jacobian[i]
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
    return forces
