# SPDX-License-Identifier: Apache-2.0
"""What of the floor a robot covers, in its base frame."""

from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np
from wasd_core.errors import UserError

# Circles along the edge of a rectangle reach inward so far [m].
_DEPTH = 0.16


class InvalidFootprint(UserError):
    """A footprint that no robot has."""


@dataclass(frozen=True)
class Footprint:
    """
    A circle of a `radius`, or a rectangle of `half_length` (x) and `half_width` (y) [m].

    Both lie about the origin of the base frame, about which the robot turns.
    """

    radius: float = 0.0
    half_length: float = 0.0
    half_width: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is neither, or both."""
        sizes = (self.radius, self.half_length, self.half_width)
        circle, rectangle = sizes[0] > 0.0, min(sizes[1:]) > 0.0
        if circle == rectangle or not all(0.0 <= size < math.inf for size in sizes):
            raise InvalidFootprint(
                'a footprint must be a circle with a radius > 0 m or a rectangle with a '
                f'half_length and a half_width > 0 m, got {self}'
            )

    @property
    def is_circle(self) -> bool:
        """Whether it is the same whichever way the robot looks."""
        return self.radius > 0.0

    @property
    def inscribed(self) -> float:
        """Radius of the largest circle about the origin within it [m]."""
        return self.radius or min(self.half_length, self.half_width)

    @cached_property
    def circles(self) -> np.ndarray:
        """
        Circles that cover its edge, rows (x, y, radius) [m], shape (n, 3); one for a circle.

        What comes from outside meets one of them first. They reach beyond a rectangle by at most
        0.21 of their depth: 3.5 cm.
        """
        if self.is_circle:
            return np.array(((0.0, 0.0, self.radius),))
        depth = min(_DEPTH, self.half_length, self.half_width)
        middles = [_spread(half, depth) for half in (self.half_length, self.half_width)]
        xs, ys = middles
        edge = [(x, y) for x in xs for y in ys if x in (xs[0], xs[-1]) or y in (ys[0], ys[-1])]
        half_x = self.half_length - xs[-1]
        half_y = self.half_width - ys[-1]
        radius = math.hypot(half_x, half_y)
        return np.array([(x, y, radius) for x, y in edge])


def _spread(half: float, depth: float) -> list[float]:
    """Return middles of equal parts of -half to half, each no longer than a depth."""
    count = max(1, math.ceil(2.0 * half / depth - 1e-9))
    width = 2.0 * half / count
    return [-half + width * (index + 0.5) for index in range(count)]
