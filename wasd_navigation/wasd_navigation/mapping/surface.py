# SPDX-License-Identifier: Apache-2.0
"""Surfaces that a planar scan sees: points with the direction that they face."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.scan import Scan

# Neighbours of a point lie on the same surface within this distance [m] ...
REACH = 0.16
# ... at most so many on each side of it.
MOST_NEIGHBOURS = 8
# Variance across a surface over that along it, above which it is none.
ROUNDEST = 0.12
# Points this far off their line are no surface: three times the noise of a usual lidar [m].
ROUGHEST = 0.03
# Cosine of the angle between normal and ray where neighbours are too far to know the normal.
GRAZING = 0.15


class Surface(NamedTuple):
    """
    What of a scan lies on a surface.

    `points`, shape (m, 4): x, y [m] of each and the normal nx, ny there, of length 1 and to where
    the lidar is, in the base frame. `slants`, shape (n,), is the cosine of the angle between each
    of the scan's rays and the normal where it ends, `GRAZING` where that is not known.
    """

    points: np.ndarray
    slants: np.ndarray


def find_surface(scan: Scan) -> Surface:
    """Return what lies on a surface: on the least squares' line through its neighbours."""
    return Surface(*_find_surface(scan.ends, scan.hits, scan.origin))


@jit
def _find_surface(
    ends: np.ndarray, hits: np.ndarray, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    count = ends.shape[0]
    surface, slants = np.empty((count, 4)), np.full(count, GRAZING)
    found = 0
    for index in range(count):
        if not hits[index]:
            continue
        x, y = ends[index]
        n, sx, sy, sxx, sxy, syy = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for side in (-1, 1):
            for step in range(1, MOST_NEIGHBOURS + 1):
                other = index + side * step
                if other < 0 or other >= count or not hits[other]:
                    break
                dx, dy = ends[other, 0] - x, ends[other, 1] - y
                if dx * dx + dy * dy > REACH * REACH:
                    break
                n += 1.0
                sx += dx
                sy += dy
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
        if n < 3.0:
            continue
        mx, my = sx / n, sy / n
        cxx, cxy, cyy = sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my
        middle, spread = 0.5 * (cxx + cyy), math.hypot(0.5 * (cxx - cyy), cxy)
        along, across = middle + spread, middle - spread
        if across > ROUNDEST * along or across > ROUGHEST * ROUGHEST:
            continue
        # The line has the angle of the largest variance; its normal is a quarter turn on.
        angle = 0.5 * math.atan2(2.0 * cxy, cxx - cyy)
        nx, ny = -math.sin(angle), math.cos(angle)
        toward = nx * (origin[0] - x) + ny * (origin[1] - y)
        if toward < 0.0:
            nx, ny = -nx, -ny
        slants[index] = abs(toward) / max(1e-9, math.hypot(origin[0] - x, origin[1] - y))
        surface[found] = (x, y, nx, ny)
        found += 1
    return surface[:found].copy(), slants
