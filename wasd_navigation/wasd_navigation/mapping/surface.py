# SPDX-License-Identifier: Apache-2.0
"""Surfaces that a planar scan sees: points with the direction that they face."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.records import Scan

# Beyond this share of what a lidar sees, with a ray among so many on each side that hits nothing,
# those are seen that noise has brought near: they seem nearer than they are, and tell nothing.
FAR, LOST = 0.8, 4
# Neighbours of a point lie on the same surface within this distance [m], or within so many
# deviations of a range ...
REACH, REACH_DEVIATIONS = 0.16, 8.0
# ... at most so many on each side of it.
MOST_NEIGHBOURS = 8
# Variance across a surface over that along it, above which it is none.
ROUNDEST = 0.12
# Points this far off their line are no surface [m], or so many deviations of a range.
ROUGHEST, ROUGH_DEVIATIONS = 0.03, 2.0
# Cosine of the angle between normal and ray where neighbours are too far to know the normal.
GRAZING = 0.15
# Noise is learnt of ranges above this [m], of so many at least in a scan, as a mean of so many
# scans; half of what is normal is within this many deviations. No lidar has more than this share.
NEAREST, FEWEST, LEARNT, MEDIAN, LARGEST_SHARE = 1.5, 30, 30, 0.6745, 0.05
# Cosine of the angle between normal and ray from which on a ray's end is known by its neighbours.
STEEP = 0.3
# A post is no wider than this [m], and rays on both sides of it go farther by so much [m] and so
# many deviations; its middle is about so far behind its visible side [m].
WIDEST_POST, LEAST_GAP, GAP_DEVIATIONS, POST = 0.09, 0.3, 4.0, 0.02


class Noise(NamedTuple):
    """Standard deviation of ranges: a `least` [m], or a `share` of them where that is more."""

    least: float
    share: float


class RangeNoise:
    """
    Learns how noisy ranges are, as a share of them, from how scans waver.

    A range less the mean of its neighbours' has, on whatever surface, a deviation of sqrt(3/2)
    times that of one range; the median over a scan does not heed the edges of things.
    """

    def __init__(self, least: float, share: float) -> None:
        """Take the least deviation [m], and the share if it is known, else NaN."""
        self._known = Noise(least, share)
        self.reset()

    def reset(self) -> None:
        """Forget what was learnt."""
        self._share, self._scans = 0.0, 0

    @property
    def share(self) -> float:
        """The share that is known, or was learnt."""
        known = self._known.share
        return min(self._share, LARGEST_SHARE) if math.isnan(known) else known

    @property
    def noise(self) -> Noise:
        """What is known, or was learnt."""
        return self._known._replace(share=self.share)

    def take(self, share: float) -> None:
        """Go on with what was learnt once."""
        self._share, self._scans = share, LEARNT

    def step(self, scan: Scan) -> Noise:
        """Take in a scan, and return the noise."""
        if not math.isnan(self._known.share):
            return self._known
        seen = _waver(scan.ends, scan.hits, scan.begins)
        if len(seen) >= FEWEST:
            self._scans = min(self._scans + 1, LEARNT)
            share = _median(seen) / (MEDIAN * math.sqrt(1.5))
            self._share += (share - self._share) / self._scans
        return self.noise


def _median(values: np.ndarray) -> float:
    """Return the median, as `np.median` does in eight times the time."""
    ranked = np.sort(values)
    return 0.5 * float(ranked[(len(values) - 1) // 2] + ranked[len(values) // 2])


@jit
def _waver(ends: np.ndarray, hits: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Return by what shares far ranges differ from the means of their neighbours'."""
    count = ends.shape[0]
    ranges = np.zeros(count)
    for index in range(count):
        if hits[index]:
            ranges[index] = math.hypot(
                ends[index, 0] - begins[index, 0], ends[index, 1] - begins[index, 1]
            )
    seen = np.empty(count)
    found = 0
    for index in range(1, count - 1):
        before, here, after = ranges[index - 1], ranges[index], ranges[index + 1]
        if here > NEAREST and before > 0.0 and after > 0.0:
            seen[found] = abs(here - 0.5 * (before + after)) / here
            found += 1
    return seen[:found].copy()


class Surface(NamedTuple):
    """
    What of a scan lies on a surface.

    `points`, shape (m, 5): x, y [m] of each, the normal nx, ny there, of length 1 and
    to where the lidar is, in the base frame, and the deviation of its place along that [m]. A
    post, narrow and free on both sides, has the normal (0, 0): its place is known both ways.
    `slants`, shape (n,), is the cosine of the angle between each of the scan's rays and the normal
    where it ends, `GRAZING` where that is not known; `ends`, shape (n, 2), where rays meet the
    line through their neighbours, or end; `deviations`, shape (n,), of that along the ray [m].
    """

    points: np.ndarray
    slants: np.ndarray
    ends: np.ndarray
    deviations: np.ndarray


def find_surface(scan: Scan, noise: Noise) -> Surface:
    """Return what lies on a surface: on the least squares' line through its neighbours."""
    return Surface(*_find_surface(scan.ends, scan.hits, scan.begins, (noise.least, noise.share)))


@jit
def _find_surface(
    ends: np.ndarray, hits: np.ndarray, begins: np.ndarray, noise: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    count = ends.shape[0]
    surface, slants = np.empty((2 * count, 5)), np.full(count, GRAZING)
    smooth, deviations = ends.copy(), np.full(count, noise[0])
    found = 0
    sight = np.inf  # of the lidar: how far rays go that hit nothing
    for index in range(count):
        if not hits[index]:
            x, y = ends[index, 0] - begins[index, 0], ends[index, 1] - begins[index, 1]
            sight = min(sight, math.hypot(x, y))
    for index in range(count):
        if not hits[index]:
            continue
        x, y = ends[index]
        to_x, to_y = begins[index, 0] - x, begins[index, 1] - y
        length = max(1e-9, math.hypot(to_x, to_y))
        deviation = max(noise[0], noise[1] * length)
        deviations[index] = deviation
        reach = max(REACH, REACH_DEVIATIONS * deviation)
        if length > FAR * sight:
            is_lost = False
            for other in range(max(0, index - LOST), min(count, index + LOST + 1)):
                is_lost |= not hits[other]
            if is_lost:
                continue
        n, sx, sy, sxx, sxy, syy = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for side in (-1, 1):
            for step in range(1, MOST_NEIGHBOURS + 1):
                other = index + side * step
                if other < 0 or other >= count or not hits[other]:
                    break
                dx, dy = ends[other, 0] - x, ends[other, 1] - y
                if dx * dx + dy * dy > reach * reach:
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
        roughest = max(ROUGHEST, ROUGH_DEVIATIONS * deviation)
        if across > ROUNDEST * along or across > roughest * roughest:
            continue
        # The line has the angle of the largest variance; its normal is a quarter turn on.
        angle = 0.5 * math.atan2(2.0 * cxy, cxx - cyy)
        nx, ny = -math.sin(angle), math.cos(angle)
        toward = nx * to_x + ny * to_y
        if toward < 0.0:
            nx, ny, toward = -nx, -ny, -toward
        slant = toward / length
        slants[index] = slant
        # From the point to the line through the mean of its neighbours, along the normal.
        off = nx * mx + ny * my
        surface[found, 0], surface[found, 1] = x, y
        surface[found, 2], surface[found, 3] = nx, ny
        surface[found, 4] = max(noise[0], deviation * slant)
        found += 1
        if slant > STEEP:
            smooth[index, 0], smooth[index, 1] = (
                x + off / slant * to_x / length,
                y + off / slant * to_y / length,
            )
            # Of a mean of n, at an end of the line more.
            deviations[index] = deviation / math.sqrt(0.5 * n)
    found = _add_posts(ends, hits, begins, noise, surface, found)
    return surface[:found].copy(), slants, smooth, deviations


@jit
def _add_posts(
    ends: np.ndarray,
    hits: np.ndarray,
    begins: np.ndarray,
    noise: tuple[float, float],
    surface: np.ndarray,
    found: int,
) -> int:
    """Add what is narrow and stands free, as the legs of a table; return how many there are."""
    count = ends.shape[0]
    ranges = np.empty(count)
    for index in range(count):
        ranges[index] = math.hypot(
            ends[index, 0] - begins[index, 0], ends[index, 1] - begins[index, 1]
        )
    first = 1
    while first < count - 1:
        deviation = max(noise[0], noise[1] * ranges[first])
        gap = LEAST_GAP + GAP_DEVIATIONS * deviation
        last = first
        while last < count - 1 and hits[last + 1] and abs(ranges[last + 1] - ranges[last]) < gap:
            last += 1
        width = math.hypot(ends[last, 0] - ends[first, 0], ends[last, 1] - ends[first, 1])
        if hits[first] and last < count - 1 and width < WIDEST_POST + deviation:
            n, x, y, length = last - first + 1, 0.0, 0.0, 0.0
            for index in range(first, last + 1):
                x += ends[index, 0] / n
                y += ends[index, 1] / n
                length += ranges[index] / n
            is_free = ranges[first - 1] > length + gap and ranges[last + 1] > length + gap
            if is_free and found < surface.shape[0]:
                away = POST / max(1e-9, length)
                surface[found, 0] = x + away * (x - begins[first, 0])
                surface[found, 1] = y + away * (y - begins[first, 1])
                surface[found, 2] = surface[found, 3] = 0.0
                surface[found, 4] = math.hypot(deviation / math.sqrt(n), POST)
                found += 1
        first = last + 1
    return found
