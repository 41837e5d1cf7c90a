# SPDX-License-Identifier: Apache-2.0
"""How sure odometry is of its pose: less with each metre and each turn."""

import math
from typing import NamedTuple


class PlanarCovariance(NamedTuple):
    """The symmetric covariance of x, y [m] and yaw [rad]."""

    xx: float = 0.0
    xy: float = 0.0
    yy: float = 0.0
    x_yaw: float = 0.0
    y_yaw: float = 0.0
    yaw_yaw: float = 0.0


class Growth(NamedTuple):
    """
    Variances that a path and a turn add.

    A path of s [m] and a turn of t [rad] are uncertain by `distance` |s| [m^2] along the path,
    and by `turn` |t| + `drift` |s| [rad^2] in heading.
    """

    distance: float = 0.0
    turn: float = 0.0
    drift: float = 0.0


def grown(
    before: PlanarCovariance,
    growth: Growth,
    forward: float,
    turn: float,
    heading: float,
    shift: tuple[float, float],
) -> PlanarCovariance:
    """
    Return the covariance after a move: P' = F P F^T + Q.

    The place has shifted by `shift` [m]. F carries the error of the heading into it:
    dx' = dx - shift_y dyaw and dy' = dy + shift_x dyaw. Q is the move's own error: along its
    mean heading, and in yaw.
    """
    if forward == 0.0 and turn == 0.0:
        return before
    a, b = -shift[1], shift[0]
    along = growth.distance * abs(forward)
    around = growth.turn * abs(turn) + growth.drift * abs(forward)
    cos, sin = math.cos(heading), math.sin(heading)
    xx, xy, yy, x_yaw, y_yaw, yaw_yaw = before
    return PlanarCovariance(
        xx + 2.0 * a * x_yaw + a * a * yaw_yaw + along * cos * cos,
        xy + b * x_yaw + a * y_yaw + a * b * yaw_yaw + along * cos * sin,
        yy + 2.0 * b * y_yaw + b * b * yaw_yaw + along * sin * sin,
        x_yaw + a * yaw_yaw,
        y_yaw + b * yaw_yaw,
        yaw_yaw + around,
    )
