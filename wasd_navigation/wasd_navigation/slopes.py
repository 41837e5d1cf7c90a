# SPDX-License-Identifier: Apache-2.0
"""Knows slopes in the scans of a planar lidar that sways: what it sees higher is farther away."""

from collections import deque
from dataclasses import replace

import numpy as np

from wasd_navigation.records import Scan
from wasd_navigation.se2 import transform

# So many scans are compared, at so many bearings.
COMPARED, BEARINGS = 20, 360
# What leans is seen, in so many scans, at distances and heights of such deviations [m], more than
# noise makes of a wall. The correlation of the two, squared, is 0.94 for a slope with noise of
# 0.01 m, and at most 8 / pi**2 for the edge of a table, with a wall behind it, in a sine's sway.
FEWEST, SPREAD, RISE, ALIKE = 4, 0.04, 0.002, 0.85


class Slopes:
    """
    Takes hits on slopes out of scans: they are not at one place, as walls are.

    A lidar that sways, or rises, sees a wall at one distance at all heights. On a slope its rays
    end the farther away the higher they end, and a robot that is matched against that goes astray.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Know of no scan."""
        self._seen: deque[np.ndarray] = deque(maxlen=COMPARED)

    def leave_out(self, scan: Scan, pose: np.ndarray) -> Scan:
        """Return a scan at a pose in odometry's frame; where its rays met slopes, none hits."""
        if scan.heights is None:
            return scan
        origin = transform(pose, scan.origin[None])[0]
        hits = np.flatnonzero(scan.hits)
        self._seen.append(np.column_stack((transform(pose, scan.points), scan.heights[hits])))
        x, y, heights = np.concatenate(self._seen).T
        x, y = x - origin[0], y - origin[1]
        ways = np.hypot(x, y)
        bins = np.floor(np.arctan2(y, x) * (0.5 * BEARINGS / np.pi)).astype(int) % BEARINGS
        count = np.bincount(bins, minlength=BEARINGS)

        def mean(values: np.ndarray) -> np.ndarray:
            return np.asarray(np.bincount(bins, values, BEARINGS) / np.maximum(count, 1))

        ways, heights = ways - mean(ways)[bins], heights - mean(heights)[bins]
        spread, rise, both = mean(ways * ways), mean(heights * heights), mean(ways * heights)
        leans = (count >= FEWEST) & (spread > SPREAD**2) & (rise > RISE**2) & (both > 0.0)
        leans &= both * both > ALIKE * spread * rise
        firm = scan.hits.copy()
        firm[hits[leans[bins[len(bins) - len(hits) :]]]] = False
        return replace(scan, hits=firm)
