# SPDX-License-Identifier: Apache-2.0
"""How a quadruped compares with the Go2: scale factors by Froude, and poses that look alike."""

from dataclasses import dataclass
from functools import cache
import math
import re

import numpy as np

from robot_description.leg import Leg
from robot_description.quadruped import Quadruped

# The built-in Go2, for which everything is tuned: upper and lower leg [m], whole mass [kg].
GO2_LINK = 0.213
GO2_MASS = 16.086
# Rotor inertia as a geared joint feels it [kg m^2]; unitree_mujoco's value for the Go2.
REFLECTED_INERTIA = 0.01
# A ratio closer to one than this is one: the last digits of a description say nothing.
RESOLUTION = 1e-4
# Poses keep away from the stops by this much [rad].
STOP_MARGIN = 0.05

# Powers of (length, mass) by which a unit grows on a robot that moves alike under the same
# gravity: time goes with the square root of length.
_POWERS = {
    'm': (1.0, 0.0),
    's': (0.5, 0.0),
    'kg': (0.0, 1.0),
    'N': (0.0, 1.0),
    'rad': (0.0, 0.0),
    '1': (0.0, 0.0),
}


@dataclass(frozen=True)
class Scale:
    """Leg length and mass of a robot as multiples of the Go2's."""

    length: float = 1.0
    mass: float = 1.0

    def of(self, unit: str) -> float:
        """
        Return how many times larger than on the Go2 a quantity is, by its unit.

        Dynamic similarity at equal gravity: 'm' grows with length, 's' with its square root,
        'N' with mass, and so everything made of them ('m/s', 'N m s/rad', '1/s^2').

        Raises:
            ValueError: the unit is made of something else.
        """
        length, mass = _dimension(unit)
        return float(self.length**length * self.mass**mass)


GO2 = Scale()


@cache
def _dimension(unit: str) -> tuple[float, float]:
    """Powers of (length, mass) of a unit, e.g. `N m s/rad` or `1/s^2`."""
    above, _, below = unit.partition('/')
    length, mass = _powers(above)
    length_below, mass_below = _powers(below)
    return length - length_below, mass - mass_below


def _powers(product: str) -> tuple[float, float]:
    """Powers of (length, mass) of units multiplied, e.g. `N m s` or `s^2`."""
    length = mass = 0.0
    for factor in product.split():
        found = re.fullmatch(r'(\w+?)(?:\^(\d+))?', factor)
        if found is None or found[1] not in _POWERS:
            raise ValueError(f'unknown unit {factor!r}')
        power = float(found[2] or 1)
        length += power * _POWERS[found[1]][0]
        mass += power * _POWERS[found[1]][1]
    return length, mass


def scale_of(quadruped: Quadruped) -> Scale:
    """Return how a robot compares with the Go2 in size and mass."""
    legs = [leg.length for leg in quadruped.legs]
    return Scale(_ratio(sum(legs) / len(legs), 2.0 * GO2_LINK), _ratio(quadruped.mass, GO2_MASS))


def _ratio(value: float, reference: float) -> float:
    ratio = value / reference
    return 1.0 if abs(ratio - 1.0) < RESOLUTION else ratio


def similar_pose(quadruped: Quadruped, thigh: float, calf: float) -> np.ndarray:
    """
    Return leg angles (12,) [rad] with which a robot stands as the Go2 does with those given.

    The feet are as far below the trunk and beside their hips, in leg lengths, however the leg is
    divided; all are at one level. Knees that point forward get the mirror image. Angles keep away
    from the joints' stops; a knee that would not fold so far leaves the trunk higher.
    """
    length = scale_of(quadruped).length
    middle = sum(float(leg.hip[2]) for leg in quadruped.legs) / len(quadruped.legs)
    angles = []
    for leg in quadruped.legs:
        raised = float(leg.hip[2]) - middle - leg.drop
        angles.append(_similar_leg(leg, thigh, calf, length, raised))
    return np.concatenate(angles)


def _similar_leg(leg: Leg, thigh: float, calf: float, length: float, raised: float) -> np.ndarray:
    """Angles (3,) of one leg whose thigh turns `raised` [m] above the mean hip."""
    forward = -GO2_LINK * (math.sin(thigh) + math.sin(thigh + calf))
    down = GO2_LINK * (math.cos(thigh) + math.cos(thigh + calf))
    alike = _reach(GO2_LINK, GO2_LINK, forward, down)
    x, depth = length * forward, length * down + raised
    reached = _reach(leg.thigh, leg.calf, x, depth)
    # As differences, so that the Go2 gets exactly the angles that it was given.
    thigh, calf = thigh + (reached[0] - alike[0]), calf + (reached[1] - alike[1])
    low, high = leg.lower + STOP_MARGIN, leg.upper - STOP_MARGIN
    if leg.bend < 0.0:
        low, high = -high, -low  # of the mirror image
    if not low[2] <= calf <= high[2]:
        calf = min(max(calf, float(low[2])), float(high[2]))
        thigh = math.atan2(-x, depth) - _inner_angle(leg.thigh, leg.calf, calf)
    hip = min(max(0.0, float(leg.lower[0])), float(leg.upper[0]))
    thigh = min(max(thigh, float(low[1])), float(high[1]))
    return np.array((hip, leg.bend * thigh, leg.bend * calf))


def _reach(thigh: float, calf: float, forward: float, down: float) -> tuple[float, float]:
    """Thigh and calf angle [rad], knee backward, that bring the foot there or nearest to it."""
    nearest, farthest = abs(thigh - calf) + 1e-4, thigh + calf - 1e-4
    distance = min(max(math.hypot(forward, down), nearest), farthest)
    cosine = (distance**2 - thigh**2 - calf**2) / (2.0 * thigh * calf)
    knee = -math.acos(max(-1.0, min(1.0, cosine)))
    return math.atan2(-forward, down) - _inner_angle(thigh, calf, knee), knee


def _inner_angle(thigh: float, calf: float, knee: float) -> float:
    """Angle [rad] from the thigh to the line between hip and foot."""
    return math.atan2(calf * math.sin(knee), thigh + calf * math.cos(knee))
