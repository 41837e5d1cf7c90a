# SPDX-License-Identifier: Apache-2.0
"""Inertias that no distribution of mass has, and the nearest that one does."""

import numpy as np

from robot_description.urdf import Robot

# A second moment below this share of their sum counts as impossible: MuJoCo refuses it.
SMALLEST_SHARE = 1e-9
# What it is raised to, and the radius of gyration [m] of a mass without any extent.
RAISED_SHARE = 1e-6
SMALLEST_RADIUS = 1e-4
# A negative moment of this share of their sum is more than rounding.
WORTH_SAYING = 1e-3
# Nothing to MuJoCo, whose limit is lower by two digits [kg m^2].
SMALLEST_MOMENT = 1e-12


def _second_moments(inertia: np.ndarray) -> np.ndarray:
    moments: np.ndarray = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return moments


def _smallest_share(inertia: np.ndarray) -> float:
    """Return the smallest second moment as a share of their sum; 0 for none."""
    values = np.linalg.eigvalsh(_second_moments(inertia))
    total = float(np.abs(values).sum())
    return float(values[0]) / total if total > SMALLEST_MOMENT else 0.0


def possible_inertia(inertia: np.ndarray, mass: float) -> np.ndarray | None:
    """
    Return the inertia (3, 3) [kg m^2] nearest to an impossible one; None when it is possible.

    A body's second moments of mass S = tr(I)/2 1 - I cannot be negative along any direction,
    which says at once that principal inertias are positive and obey the triangle inequality.
    Negative ones are raised to next to nothing [Wensing2018, eq. 9].
    """
    values, directions = np.linalg.eigh(_second_moments(inertia))
    total = float(np.abs(values).sum())
    if values[0] > max(SMALLEST_SHARE * total, 0.1 * SMALLEST_MOMENT):
        return None
    floor = max(RAISED_SHARE * total, mass * SMALLEST_RADIUS**2, SMALLEST_MOMENT)
    raised = directions @ np.diag(np.maximum(values, floor)) @ directions.T
    mended: np.ndarray = np.trace(raised) * np.eye(3) - raised
    return mended


def impossible_inertias(robot: Robot) -> tuple[str, ...]:
    """
    Return a line for each link whose inertia no body can have.

    Points, rods and plates, which have none in some direction, and rounding are not worth a line.
    """
    return tuple(
        f'inertia of link {link.name!r}: impossible: using the nearest that a body can have '
        f'(principal {", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(link.inertia))})'
        for link in robot.links.values()
        if link.mass > 0.0 and _smallest_share(link.inertia) < -WORTH_SAYING
    )
