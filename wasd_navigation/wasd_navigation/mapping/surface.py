# SPDX-License-Identifier: Apache-2.0
"""Surfaces that a planar scan sees: points with the direction that they face."""

import math

from numba import njit
import numpy as np

from wasd_navigation.scan import Scan

# Neighbours of a point lie on the same surface within this distance [m] ...
REACH = 0.16
# ... at most so many on each side of it.
MOST_NEIGHBOURS = 8
# Variance across a surface over that along it, above which it is none.
ROUNDEST = 0.12
# Points this far off their line are no surface: three times the noise of a usual lidar [m].
ROUGHEST = 0.03


def find_surface(scan: Scan) -> np.ndarray:
    """
    Return the points of a scan that lie on a surface, and its normals: x, y, nx, ny, shape (m, 4).

    In the base frame; normals have length 1 and point to where the lidar is. The line through a
    point and its neighbours is that of least squares.
    """
    surface: np.ndarray = _find_surface(scan.ends, scan.hits, scan.origin)
    return surface


@njit(cache=True)
def _find_surface(ends: np.ndarray, hits: np.ndarray, origin: np.ndarray) -> np.ndarray:
    count = ends.shape[0]
    surface = np.empty((count, 4))
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
        if nx * (origin[0] - x) + ny * (origin[1] - y) < 0.0:
            nx, ny = -nx, -ny
        surface[found] = (x, y, nx, ny)
        found += 1
    return surface[:found].copy()
