# SPDX-License-Identifier: Apache-2.0
"""Tracks a pose by odometry and scan matching, and learns odometry's errors."""

from collections import deque
import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.mapping.local_map import Fit, fit_scan, LocalMap
from wasd_navigation.odometry import LEAP, OdometryGrowth
from wasd_navigation.se2 import add, compose, invert, sandwich, turn_axes, wrap

ROUNDS = 12
# How a map of few scans wavers: variances of the pose at each scan [m^2], [rad^2].
WAVER = np.diag((5e-4**2, 5e-4**2, 2.5e-4**2))
# What a fit tells is believed by this share: its errors are not independent.
TRUST = 0.1
# Of what odometry says of its error so much is new at each move; the rest lasts, as that of the
# size of a wheel, and is learnt. So is at least, and at most, known of it: shares of way and turn.
NEW = np.sqrt(np.array((0.05, 0.05, 0.15)))  # of x, y, yaw, and their deviations
SUREST, VAGUEST, LARGEST = 0.02, 0.1, 0.15
# When a scan moves the pose by so many deviations of what odometry says, squared, and by so much
# [m], [rad], the wheels have slipped; then the robot is within this of where odometry says.
SLIP, LEAST_SLIP, LEAST_TURN = 30.0, 0.01, 0.01
LOOSE = np.diag((1.0 / 0.15**2, 1.0 / 0.15**2, 1.0 / 0.1**2))
# A robot is stuck if within STUCK_SCANS its odometry went at least STUCK_WAY [m], it came less
# than this share of that, and at least STUCK_SLIPS scans saw slip, one of the last STUCK_LAST too.
STUCK_SHARE, STUCK_WAY, STUCK_SCANS, STUCK_SLIPS, STUCK_LAST = 0.3, 0.3, 12, 3, 6
STUCK = 'stuck: the wheels turn, the robot does not move'


class Tracker:
    """
    Keeps a pose, its covariance, and correction factors of odometry.

    `move` comes first, then `fit` with a map of surfaces, then `believe` if the fit is one.
    """

    def __init__(self, least_noise: float, waver: np.ndarray | None = None) -> None:
        """Take the least deviation of a point on a surface [m], and how its map wavers, (3, 3)."""
        self._noise = least_noise
        self._waver = np.zeros((3, 3)) if waver is None else waver
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next odometry is the first."""
        self._growth = OdometryGrowth()
        self.pose = np.zeros(3)
        self.scales: np.ndarray = np.zeros(2)  # errors of odometry's way and turn, as shares
        self._joint: np.ndarray = np.zeros((5, 5))  # covariance of the pose and of those
        self._knows_scales = False
        self.move_growth: np.ndarray = np.zeros((3, 3))  # covariance of the last move
        self.told: np.ndarray = np.zeros((3, 3))  # what the last fit tells of the pose
        self.has_slipped = False
        self._start, self._begin = np.zeros(3), np.zeros(3)
        self._moves: deque[tuple[float, np.ndarray, bool]] = deque(maxlen=STUCK_SCANS)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the pose, shape (3, 3)."""
        covariance: np.ndarray = self._joint[:3, :3].copy()
        return covariance

    @property
    def is_stuck(self) -> bool:
        """Whether the wheels turn and the robot does not come along."""
        way = sum(move[0] for move in self._moves)
        if way < STUCK_WAY or sum(move[2] for move in self._moves) < STUCK_SLIPS:
            return False
        if not any(slips for _, _, slips in list(self._moves)[-STUCK_LAST:]):
            return False
        first = self._moves[0][1]
        return bool(math.hypot(*(self.pose - first)[:2]) < STUCK_SHARE * way)

    def put(self, pose: np.ndarray, covariance: np.ndarray) -> None:
        """Believe another pose with its covariance, independent of odometry."""
        self.pose = np.array(pose, dtype=float)
        self._joint[:3, :] = self._joint[:, :3] = 0.0
        self._joint[:3, :3] = covariance
        self._moves.clear()

    def shift(self, change: np.ndarray) -> None:
        """Let the map be moved by T_new_old, shape (3,), and the robot with it."""
        self.pose = compose(change, self.pose)
        yaw = float(change[2])
        self._joint[:3, :3] = turn_axes(self._joint[:3, :3], yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        turned = np.array(((cos, -sin), (sin, cos))) @ self._joint[:2, 3:]
        self._joint[:2, 3:], self._joint[3:, :2] = turned, turned.T
        for index, (way, pose, slips) in enumerate(self._moves):
            self._moves[index] = way, compose(change, pose), slips

    def leap(self) -> None:
        """Keep the pose as odometry begins again."""
        self._growth = OdometryGrowth()
        self._joint[:3, :3] += LEAP

    def move(self, odometry: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Move as odometry has since the last call; return by what, as it is believed, (3,)."""
        said, growth = self._growth.step(odometry, covariance)
        way = math.hypot(said[0], said[1])
        if not self._knows_scales and way > 0.0:
            self._knows_scales = True
            sure = float(np.clip(math.sqrt(abs(growth[0, 0]) / way), SUREST, VAGUEST))
            self._joint[3, 3] = self._joint[4, 4] = sure * sure
        move = said * (1.0 + self.scales[[0, 0, 1]])
        self.move_growth = growth * np.outer(NEW, NEW)
        self._begin = self.pose.copy()
        self._joint = _predict(self._joint, self.pose, said, move, self.move_growth + self._waver)
        self.pose = self._start = np.asarray(compose(self.pose, move))
        self._moves.append((way, self._begin, False))
        return move

    def fit(self, local: LocalMap, surface: np.ndarray) -> Fit:
        """
        Return where a scan's surface fits best, as far as odometry lets it.

        Where it speaks against odometry, the wheels have slipped: then it is believed alone.
        """
        prior = invert(self._joint[:3, :3])
        fit = Fit(*fit_scan(local, surface, self._start, prior, self._noise, ROUNDS))
        self._prior = prior
        off = fit.pose - self._start
        off[2] = wrap(off[2])
        is_far = math.hypot(off[0], off[1]) > LEAST_SLIP or abs(off[2]) > LEAST_TURN
        self.has_slipped = bool(is_far and off @ prior @ off > SLIP)
        if self.has_slipped:
            loose = Fit(*fit_scan(local, surface, self._start, LOOSE, self._noise, 2 * ROUNDS))
            if loose.share >= fit.share:
                self._prior = LOOSE
                fit = loose
        return fit

    def believe(self, fit: Fit) -> None:
        """Be where a fit is; learn from it what is wrong with odometry."""
        self.told = TRUST * fit.information
        if self.has_slipped:
            way, begin, _ = self._moves[-1]
            self._moves[-1] = way, begin, True
            self._joint[:3, :] = self._joint[:, :3] = 0.0
            self._joint[:3, :3] = invert(self._prior + self.told)
        else:
            self._joint, learnt = _learn(self._joint, fit.pose - self._start, self.told)
            self.scales = np.clip(self.scales + learnt, -LARGEST, LARGEST)
        self.pose = fit.pose


@jit
def _predict(
    joint: np.ndarray, pose: np.ndarray, said: np.ndarray, move: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Return the covariance of pose and scales after a move; odometry `said` this move."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    F = np.eye(5)
    F[0, 2] = -(sin * move[0] + cos * move[1])
    F[1, 2] = cos * move[0] - sin * move[1]
    F[0, 3] = cos * said[0] - sin * said[1]
    F[1, 3] = sin * said[0] + cos * said[1]
    F[2, 4] = said[2]
    moved = sandwich(F, joint)
    add(moved, turn_axes(growth, pose[2]))
    return moved


@jit
def _learn(joint: np.ndarray, step: np.ndarray, told: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the covariance after a fit that has moved the pose by a step, and what scales move by.

    Pose and scales are jointly normal: the scales follow the pose by regression.
    """
    before = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            before[i, j] = joint[i, j]
    inverted = invert(before)
    known = inverted.copy()
    add(known, told)
    after = invert(known)
    away = np.empty(3)
    for i in range(3):
        away[i] = step[i]
    away[2] = (away[2] + math.pi) % (2.0 * math.pi) - math.pi
    A, learnt = np.zeros((2, 3)), np.zeros(2)
    for i in range(2):
        for j in range(3):
            for k in range(3):
                A[i, j] += joint[3 + i, k] * inverted[k, j]
            learnt[i] += A[i, j] * away[j]
    result = np.zeros((5, 5))
    add(result, after)
    for i in range(2):
        for j in range(3):
            for k in range(3):
                result[3 + i, j] += A[i, k] * after[k, j]
            result[j, 3 + i] = result[3 + i, j]
    for i in range(2):
        for j in range(2):
            result[3 + i, 3 + j] = joint[3 + i, 3 + j]
            for k in range(3):
                for m in range(3):
                    result[3 + i, 3 + j] -= A[i, k] * (before[k, m] - after[k, m]) * A[j, m]
    return result, learnt
