# SPDX-License-Identifier: Apache-2.0
"""
Follows what moves in scans: people, other robots.

Points that are not of the map are grouped, and a Kalman filter of constant velocity follows the
middle of each group (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and
Navigation, 2001, 6.3.2).
"""

import math

import numpy as np

# Neighbouring points farther apart than this, and than this share of their range, are of two
# things [m]; wider ones than this do not walk.
_GAP, _GAP_SHARE, _WIDEST = 0.2, 0.05, 1.0
# What is seen of somebody is his front: his middle is behind it, and he is no thinner [m].
_BEHIND, _LEAST_RADIUS, _SPARE = 0.12, 0.22, 0.04
# Somebody is found again within so far of where he is expected [m], and forgotten when he is not
# seen for so long [s].
_GATE, _LOST = 0.5, 0.7
# Standard deviations: of a middle [m], of an acceleration [m/s^2], of a velocity at first [m/s].
_PLACE, _ACCELERATION, _VELOCITY = 0.03, 2.5, 0.7
# A mover is faster than this [m/s], and than noise by this factor, has been seen so often, and has
# left its last slow place by so much [m].
_SLOWEST, _SURELY, _SEEN, _LEFT = 0.25, 1.5, 3, 0.08
# Who appears nearer than this, as around a corner, is taken to come, so fast [m], [m/s], until he
# has been seen so often and is slow: what comes into view bit by bit seems to move.
_APPEARS, _COMES, _KNOWN = 1.6, 1.0, 5
# Who is not seen for so long, and was nearer than this, is hidden by the robot: he is taken to be
# where he was seen last [s], [m].
_HIDDEN, _AT_US = 0.2, 0.6
# So long after somebody has moved people are about [s].
_ABOUT = 10.0


class _Track:
    """
    Somebody: place and velocity, shape (2,) [m], [m/s], and their covariance of one axis.

    `is_moving` is whether he surely moved when he was seen last, `since` how long ago he did [s];
    `comes` whether he is taken to come, until he is known; `met` is where he was seen last.
    """

    def __init__(self, place: np.ndarray, radius: float, comes: bool) -> None:
        self.place, self.velocity, self.radius = place, np.zeros(2), radius
        self.stood, self.comes, self.met = place, comes, place
        self.seen, self.unseen, self.is_moving = 1, 0.0, False
        self.since = math.inf
        self._cov = np.diag((_PLACE**2, _VELOCITY**2))

    def foresee(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self.place = self.place + dt * self.velocity
        step = np.array(((1.0, dt), (0.0, 1.0)))
        noise = np.outer((0.5 * dt * dt, dt), (0.5 * dt * dt, dt)) * _ACCELERATION**2
        self._cov = step @ self._cov @ step.T + noise
        self.unseen += dt
        self.since += dt

    def meet(self, place: np.ndarray, radius: float) -> None:
        """Take where he is seen now."""
        gain = self._cov[:, 0] / (self._cov[0, 0] + _PLACE**2)
        error = place - self.place
        self.place = self.place + gain[0] * error
        self.velocity = self.velocity + gain[1] * error
        self._cov = self._cov - np.outer(gain, self._cov[0])
        self.radius += 0.3 * (radius - self.radius)
        self.met = self.place
        self.seen, self.unseen = self.seen + 1, 0.0
        speed = math.hypot(*self.velocity)
        is_fast = speed > max(_SLOWEST, _SURELY * math.sqrt(self._cov[1, 1]))
        if speed < _SLOWEST:
            self.stood = self.place
        has_left = math.dist(self.place, self.stood) > _LEFT
        self.is_moving = is_fast and has_left and self.seen >= _SEEN
        if self.is_moving:
            self.since = 0.0
        if self.is_moving or (self.seen >= _KNOWN and speed < _SLOWEST):
            self.comes = False


class Movers:
    """
    People and robots that move around the robot.

    `step` lets time pass, `see` takes what a scan has hit that is not of the map.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._since = math.inf  # somebody has moved [s]
        self._origin = np.zeros(2)  # of the last scan [m]

    @property
    def are_about(self) -> bool:
        """Whether somebody has moved a short while ago."""
        return self._since < _ABOUT

    @property
    def now(self) -> np.ndarray:
        """
        Rows (x, y, vx, vy, radius) [m], [m/s] of those who may move, shape (n, 5).

        A person or robot that moved a short while ago may turn on the spot and go on.
        """
        rows = []
        for one in self._tracks:
            if one.since < _ABOUT:
                is_hidden = one.unseen > _HIDDEN and math.dist(one.met, self._origin) < _AT_US
                place = one.met if is_hidden else one.place
                rows.append((*place, *one.velocity, one.radius))
            elif one.comes:
                to = self._origin - one.place
                comes = _COMES * to / max(math.hypot(*to), 1e-9)
                rows.append((*one.place, *comes, one.radius))
        return np.array(rows).reshape(-1, 5)

    def are_at(self, points: np.ndarray) -> np.ndarray:
        """Return which points, shape (n, 2) [m], belong to a mover that moved lately, bool."""
        at = np.zeros(len(points), bool)
        for one in self._tracks:
            if one.since < _ABOUT:
                at |= np.hypot(*(points - one.place).T) < one.radius
        return at

    def forget(self) -> None:
        """Forget where everybody is, before a time without steps."""
        self._tracks = []

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._since += dt
        for one in self._tracks:
            one.foresee(dt)
        self._tracks = [one for one in self._tracks if one.unseen < _LOST]

    def see(self, points: np.ndarray, origin: np.ndarray) -> None:
        """Take points in the order of their rays, shape (n, 2), of a lidar at `origin` [m]."""
        left, self._origin = list(self._tracks), origin
        for place, radius in group(points, origin):
            apart = [math.dist(place, one.place) for one in left]
            nearest = int(np.argmin(apart)) if apart else -1
            if nearest >= 0 and apart[nearest] < _GATE:
                left.pop(nearest).meet(place, radius)
            else:
                is_near = math.dist(place, origin) < _APPEARS
                self._tracks.append(_Track(place, radius, is_near))
        if any(one.is_moving for one in self._tracks):
            self._since = 0.0


def group(points: np.ndarray, origin: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Return middles, shape (2,), and radii [m] of what may walk in points, shape (n, 2)."""
    if len(points) < 2:
        return []
    ranges = np.hypot(*(points - origin).T)
    steps = np.hypot(*np.diff(points, axis=0, append=points[:1]).T)
    ends = np.flatnonzero(steps > np.maximum(_GAP, _GAP_SHARE * ranges)) + 1
    if not len(ends):
        parts = [points]
    else:
        # The last ray is beside the first.
        turned = np.roll(points, -ends[-1], axis=0)
        parts = np.split(turned, (ends[:-1] + len(points) - ends[-1]) % len(points))
    found = []
    for part in parts:
        width = math.dist(part.min(axis=0), part.max(axis=0)) if len(part) else 0.0
        if len(part) < 2 or width > _WIDEST:
            continue
        middle = 0.5 * (part.min(axis=0) + part.max(axis=0))
        away = middle - origin
        behind = middle + _BEHIND * away / max(math.hypot(*away), 1e-9)
        found.append((behind, max(0.5 * width + _SPARE, _LEAST_RADIUS)))
    return found
