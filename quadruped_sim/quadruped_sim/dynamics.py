# SPDX-License-Identifier: Apache-2.0
"""The equations of motion leg by leg, made of what Pinocchio says joint by joint."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit


class Dynamics(NamedTuple):
    """
    Terms of M dv + h = tau + J' f, with v = (base linear, base angular, legs), base axes.

    `mass` (18, 18); `bias` (18,) is h at the present velocity, gravity included; `momentum` (12,)
    is the legs' part of M v and `momentum_drift` (12,) that of C' v - g. `com` (3,) is the centre
    of mass in base axes [m], of which the mass matrix knows.
    """

    mass: np.ndarray
    bias: np.ndarray
    momentum: np.ndarray
    momentum_drift: np.ndarray
    com: np.ndarray


class PinocchioTerms(NamedTuple):
    """Mass matrix, its upper half, and h = C v + g, C and v, as Pinocchio orders its variables."""

    mass: np.ndarray
    bias: np.ndarray
    coriolis: np.ndarray
    velocity: np.ndarray


def blank_dynamics() -> Dynamics:
    """Return dynamics to be written into."""
    return Dynamics(*(np.zeros(shape) for shape in ((18, 18), 18, 12, 12, 3)))


@jit
def put_in_order(
    terms: PinocchioTerms, order: np.ndarray, signs: np.ndarray, robot: np.ndarray
) -> None:
    """
    Write the dynamics of a flat `RobotState`.

    Variable i there is `signs[i]` times Pinocchio's `order[i]`; the first six are the base's in
    both, `order` and `signs` are (18,).
    """
    M, h, C, v = terms
    out = robot[0].dynamics
    mass, bias, com = out.mass, out.bias, out.com
    momentum, momentum_drift = out.momentum, out.momentum_drift
    for i in range(18):
        row, sign = order[i], signs[i]
        bias[i] = sign * h[row]
        for j in range(18):
            column = order[j]
            # Pinocchio fills what is above the diagonal.
            mass[i, j] = sign * signs[j] * M[min(row, column), max(row, column)]
    for i in range(12):
        row = order[6 + i]
        total = drift = 0.0
        for k in range(18):
            total += M[min(row, k), max(row, k)] * v[k]
            drift += (C[row, k] + C[k, row]) * v[k]
        momentum[i] = signs[6 + i] * total
        momentum_drift[i] = signs[6 + i] * (drift - h[row])  # h = C v + g
    # The base's block holds m times the centre's cross product [Featherstone2008, eq. 2.63].
    com[0], com[1], com[2] = mass[1, 5], mass[2, 3], mass[0, 4]
    for i in range(3):
        com[i] /= mass[0, 0]
