# SPDX-License-Identifier: Apache-2.0
"""The plane on which the feet stand."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import cross3, flatten, view_of


class Plane(NamedTuple):
    """
    Where the feet stood last, (4, 3), and the plane's centre (2,), gradient (2,) and height there.

    Its unit `normal` (3,) points up, world axes; `frame` (3, 3) turns axes on the ground
    (z = normal, x nearly world x) into the world.
    """

    points: np.ndarray
    centre: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray
    frame: np.ndarray
    height: float = 0.0


class Ground:
    """
    Plane z = height + gradient . (xy - centre), low-passed.

    Remembers where each foot stood last; a foot in the air does not move the plane. The slope
    follows slowly, so that boxes average out and a ramp is felt within a few steps. `flat` is the
    `Plane` in one block of memory.
    """

    def __init__(self) -> None:
        blank = Plane(np.zeros((4, 3)), np.zeros(2), np.zeros(2), np.zeros(3), np.zeros((3, 3)))
        self.flat = flatten(blank)
        self._plane: Plane = view_of(self.flat, blank)
        self.reset(np.zeros((4, 3)))

    def reset(self, feet: np.ndarray) -> None:
        """Take level ground at the mean height of the contact points `feet` (4, 3), world [m]."""
        plane = self._plane
        plane.points[:], plane.centre[:], plane.gradient[:] = feet, feet[:, :2].mean(axis=0), 0.0
        plane.normal[:], plane.frame[:] = (0.0, 0.0, 1.0), np.eye(3)
        self.flat['height'] = feet[:, 2].mean()

    @property
    def height(self) -> float:
        """Height of the plane at its centre [m]."""
        return float(self.flat['height'][0])

    @property
    def slope(self) -> float:
        """How steep the plane is [rad]."""
        return math.atan(math.hypot(*self._plane.gradient.tolist()))

    def normal(self) -> np.ndarray:
        """Unit normal in world axes, pointing up, shape (3,)."""
        return self._plane.normal

    def frame(self) -> np.ndarray:
        """Rotation (3, 3) from axes on the ground (z = normal, x nearly world x) to the world."""
        return self._plane.frame


@jit
def height_at(plane: Plane, x: float, y: float) -> float:
    """Ground height below one point [m]."""
    ahead, left = x - plane.centre[0], y - plane.centre[1]
    return float(plane.height + plane.gradient[0] * ahead + plane.gradient[1] * left)


@jit
def fit_plane(points: np.ndarray, steepest: float) -> tuple[np.ndarray, float, float]:
    """Return the middle (3,) of `points` (4, 3) and the gradient there, not above `steepest`."""
    mean = np.zeros(3)
    for i in range(4):
        for k in range(3):
            mean[k] += 0.25 * points[i, k]
    xx = xy = yy = xz = yz = 0.0
    for i in range(4):
        x, y, z = points[i, 0] - mean[0], points[i, 1] - mean[1], points[i, 2] - mean[2]
        xx += x * x
        xy += x * y
        yy += y * y
        xz += x * z
        yz += y * z
    determinant = xx * yy - xy * xy
    gx = gy = 0.0
    if determinant > 1e-5:  # else the feet stand in a line and say nothing about slope
        gx = (yy * xz - xy * yz) / determinant
        gy = (xx * yz - xy * xz) / determinant
    size = math.sqrt(gx * gx + gy * gy)
    if size > steepest:
        gx *= steepest / size
        gy *= steepest / size
    return mean, gx, gy


@jit
def follow_plane(
    ground: np.ndarray, contacts: np.ndarray, is_contact: np.ndarray, rules: np.ndarray, dt: float
) -> None:
    """Update a flat `Plane`."""
    plane, rule = ground[0], rules[0].ground
    points, centre, gradient = plane.points, plane.centre, plane.gradient
    slope_share, height_share = min(1.0, dt / rule.slope_time), min(1.0, dt / rule.height_time)
    for i in range(4):
        for k in range(3):
            if is_contact[i]:
                points[i, k] = contacts[i, k]
    mean, gx, gy = fit_plane(points, math.tan(rule.slope_max))
    gradient[0] += slope_share * (gx - gradient[0])
    gradient[1] += slope_share * (gy - gradient[1])
    # The centre jumps with each touchdown; the height is carried along the slope to it.
    moved = height_at(plane, mean[0], mean[1])
    centre[0], centre[1] = mean[0], mean[1]
    plane.height = moved + height_share * (mean[2] - moved)
    raise_frame(plane)


@jit
def raise_frame(plane: Plane) -> None:
    """Write normal and frame."""
    gradient, normal, frame = plane.gradient, plane.normal, plane.frame
    length = math.sqrt(gradient[0] ** 2 + gradient[1] ** 2 + 1.0)
    normal[0], normal[1], normal[2] = -gradient[0] / length, -gradient[1] / length, 1.0 / length
    along = np.zeros(3)
    size = math.sqrt(normal[2] ** 2 + normal[0] ** 2)
    along[0], along[2] = normal[2] / size, -normal[0] / size
    across = cross3(normal, along)
    for k in range(3):
        frame[k, 0], frame[k, 1], frame[k, 2] = along[k], across[k], normal[k]
