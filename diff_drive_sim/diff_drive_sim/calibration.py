# SPDX-License-Identifier: Apache-2.0
"""Calibration of a differential drive from squares driven both ways."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from diff_drive_sim.odometry import DiffDriveError

QUARTER_TURN = 0.5 * math.pi


class Wheels(NamedTuple):
    """The wheels, as odometry uses them [m]."""

    left_radius: float
    right_radius: float
    separation: float


@dataclass(frozen=True)
class SquareRun:
    """
    One square, driven by odometry from the origin, heading along x.

    `turn` is 1 for left turns, -1 for right turns. `left`, `right` are the wheels' angles [rad],
    positive forward, shape (n,); `truth` is the true x, y [m] and yaw [rad] at the same instants,
    shape (n, 3), and `odometry` what odometry says at the end, x and y [m].
    """

    turn: int
    left: np.ndarray
    right: np.ndarray
    truth: np.ndarray
    odometry: tuple[float, float]

    @property
    def return_error(self) -> np.ndarray:
        """True minus calculated position at the end [m], shape (2,)."""
        moved = self.truth[-1, :2] - self.truth[0, :2]
        return np.asarray(moved - self.odometry)


class Umbmark(NamedTuple):
    """
    The result of the return errors of squares [Borenstein1996].

    `diameter_ratio` is E_d, the true right wheel's diameter over the left one's, relative to what
    odometry believes; `wheelbase_ratio` is E_b, the true wheelbase over the believed one;
    `largest_error` is E_max,syst [m].
    """

    diameter_ratio: float
    wheelbase_ratio: float
    largest_error: float

    def correct(self, believed: Wheels) -> Wheels:
        """Return the wheels by E_d and E_b; the mean radius stays as it was believed."""
        left = 2.0 / (self.diameter_ratio + 1.0)
        right = 2.0 / (1.0 / self.diameter_ratio + 1.0)
        return Wheels(
            believed.left_radius * left,
            believed.right_radius * right,
            believed.separation * self.wheelbase_ratio,
        )


def umbmark(runs: Sequence[SquareRun], side: float, separation: float) -> Umbmark:
    """
    Return UMBmark's estimate from squares with this side, driven with this wheelbase [m].

    Only where the robot ends counts. With a turn that is really 90 degrees + alpha (or less by
    it, to the right) and sides that bend to the left by beta, squares to the left end
    2 L (alpha + beta) in x and the opposite in y off, squares to the right 2 L (alpha - beta) in
    both, to first order: good for errors of a percent or two, not for large ones.

    Raises:
        DiffDriveError: there is no run to the left, or none to the right.
    """
    (x_left, y_left), (x_right, y_right) = (_centre(runs, turn) for turn in (1, -1))
    alpha = (x_left + x_right - y_left + y_right) / (8.0 * side)
    beta = (x_left - x_right - y_left - y_right) / (8.0 * side)
    wheelbase_ratio = QUARTER_TURN / (QUARTER_TURN + alpha)
    # A side is an arc of L / beta; the wheels' diameters are as the paths on both sides of it.
    radius = 0.5 * side / math.sin(0.5 * beta) if beta else math.inf
    half = 0.5 * wheelbase_ratio * separation
    diameter_ratio = (radius + half) / (radius - half) if math.isfinite(radius) else 1.0
    largest = max(math.hypot(x_left, y_left), math.hypot(x_right, y_right))
    return Umbmark(diameter_ratio, wheelbase_ratio, largest)


def _centre(runs: Sequence[SquareRun], turn: int) -> tuple[float, float]:
    errors = [run.return_error for run in runs if run.turn == turn]
    if not errors:
        raise DiffDriveError(f'no square to the {"left" if turn > 0 else "right"}')
    x, y = np.mean(errors, axis=0).tolist()
    return x, y


def least_squares(runs: Sequence[SquareRun]) -> Wheels:
    """
    Return the wheels that explain the whole true paths best, however wrong the belief was.

    In two linear steps [Antonelli2005]: the heading is a sum of wheel angles weighted by radius
    over separation; with the true heading, the path is those angles times the separation.

    Raises:
        DiffDriveError: the runs do not tell turns from straight lines.
    """
    turned = np.concatenate(
        [np.column_stack((-_from_start(run.left), _from_start(run.right))) for run in runs]
    )
    headings = np.concatenate([_from_start(np.unwrap(run.truth[:, 2])) for run in runs])
    (left, right), _, rank, _ = np.linalg.lstsq(turned, headings, rcond=1e-6)
    if rank < 2:
        raise DiffDriveError('the runs do not tell turns from straight lines')
    unit_paths = np.concatenate([_unit_path(run, left, right).ravel() for run in runs])
    paths = np.concatenate([_from_start(run.truth[:, :2]).ravel() for run in runs])
    separation = float(unit_paths @ paths / (unit_paths @ unit_paths))
    return Wheels(float(left * separation), float(right * separation), separation)


def _unit_path(run: SquareRun, left: float, right: float) -> np.ndarray:
    """Return the path, shape (n, 2), for a separation of 1 and radii over separation."""
    yaw = run.truth[0, 2] + np.concatenate(([0.0], np.cumsum(_turns(run, left, right))))
    forward = 0.5 * (left * np.diff(run.left) + right * np.diff(run.right))
    half_turn = 0.5 * np.diff(yaw)
    chord = forward * np.sinc(half_turn / np.pi)
    heading = yaw[:-1] + half_turn
    steps = np.column_stack((chord * np.cos(heading), chord * np.sin(heading)))
    return np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))


def _turns(run: SquareRun, left: float, right: float) -> np.ndarray:
    return np.asarray(right * np.diff(run.right) - left * np.diff(run.left))


def _from_start(values: np.ndarray) -> np.ndarray:
    return np.asarray(values - values[0])
