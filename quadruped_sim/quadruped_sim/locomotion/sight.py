# SPDX-License-Identifier: Apache-2.0
"""
Walking by sight: footholds and base by an elevation map [Grandia2023], [Jenelten2020].

On unknown ground it walks as without a map.
"""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, view_of
from quadruped_sim.elevation import Elevation, RESOLUTION
from quadruped_sim.estimation.ground import height_at, Plane, raise_frame
from quadruped_sim.locomotion.gait import GaitState

# Cells along a side of the window around the base; how often it is looked at [s].
CELLS, PERIOD = 40, 0.02
# Candidates of a foothold around Raibert's: so many steps of so much [m] ahead and behind, aside.
_AHEAD, _ASIDE, _APART = 10, 2, 0.02
# Cost of a candidate: per distance squared [1/m^2], per height between the cells around it that
# is more than even ground has [1/m], [m], per distance from the one held [1/m], of unknown ground,
# and per cell around it that is not known.
_FAR, _EDGE, _EVEN, _HELD, _UNKNOWN, _DOUBT = 40.0, 25.0, 0.015, 4.0, 3.0, 0.3
# Cost per height between the cells one farther around it, too [1/m], and per unknown one.
_RING, _DIM = 3.0, 0.05
# Raibert's own is taken where it costs no more than this: on even ground feet go as if blind.
_FREE = 0.15
# A foothold is chosen again until the share _DECIDED of the swing. It moves by at most _TURNED
# times the share of the swing that is left, on the Go2 [m].
_DECIDED, _TURNED = 0.75, 0.3
# No foot steps on ground so far below or above the plane through the feet, on the Go2 [m].
_DEEP, _HIGH = 0.30, 0.35
# Share of a swing after which a foot is above a foothold that was chosen: a late one falls short.
_ARRIVAL = 0.85
# How far a swing foot keeps above what lies between its ends, on the Go2 [m].
_CLEARANCE = 0.05
# The ground that base height and pitch follow: behind and ahead of the base, and aside, on the
# Go2 [m]; what of it has to be known; time constant [s].
_BEHIND, _BEFORE, _BESIDE, _ENOUGH, _TIME = -0.35, 0.50, 0.20, 0.5, 0.12
# It ignores gaps of up to so many cells; it looks for their ends so far ahead and behind [m].
_GAP, _BEYOND = 9, 0.25
# Ground whose cells are farther from its plane than this, root mean square [m], is broken.
_BROKEN = 0.015
# Steepest ground that the base follows, as a gradient.
_STEEPEST = 0.7
# Cells around a foot that are of its tread are within this height of it [m]; so many are enough.
_TREAD, _CELLS_OF_TREAD = 0.05, 6
# How fast the map's height follows what feet feel: time constant [s], most believed [m].
_LIFT_TIME, _LIFTED = 0.3, 0.08
# Speed beside edges [m/s], and the height of an edge that costs speed, one that costs all [m].
_SLOWEST, _LOW, _TALL = 0.4, 0.06, 0.14
# Between these distances ahead edges are looked for, and aside, on the Go2 [m].
_NEAR, _FARTHEST, _WIDE = 0.0, 0.7, 0.2


class SightState(NamedTuple):
    """
    What is seen.

    `window` are heights around the base [m], NaN where unknown, whose first cell is number
    `first` (2,) from the origin. `plane` is what the base follows where `share` (1,) > 0, `tread`
    what feet stand on where `tread_share` (1,) > 0. Of each leg: if a foothold `is_held` (4,), and
    where, (4, 2) [m]. `lift` (1,) is how far feet are above the map [m], `most` (1,) the speed
    that what is ahead allows [m/s], `since` (1,) the last look [s], `off` (1,) how far the ground
    that the base follows is from its plane [m], root mean square.
    """

    window: np.ndarray
    first: np.ndarray
    plane: Plane
    tread: Plane
    share: np.ndarray
    tread_share: np.ndarray
    is_held: np.ndarray
    held: np.ndarray
    lift: np.ndarray
    most: np.ndarray
    since: np.ndarray
    off: np.ndarray


def _blank_plane() -> Plane:
    return Plane(np.zeros((4, 3)), np.zeros(2), np.zeros(2), np.array((0.0, 0.0, 1.0)), np.eye(3))


class Sight:
    """
    Looks at the ground through a map, `terrain`, in the frame of the base's position.

    Without a map of this place nothing changes.
    """

    def __init__(self) -> None:
        blank = SightState(
            np.full((CELLS, CELLS), np.nan),
            np.zeros(2),
            _blank_plane(),
            _blank_plane(),
            *(np.zeros(1), np.zeros(1), np.zeros(4), np.zeros((4, 2))),
            *(np.zeros(1), np.full(1, np.inf), np.zeros(1), np.zeros(1)),
        )
        self.flat = flatten(blank)
        self._state: SightState = view_of(self.flat, blank)
        self.terrain: Elevation | None = None
        self.reset()

    def reset(self) -> None:
        """Forget what was seen, not the map."""
        state = self._state
        state.window[:] = np.nan
        state.share[:], state.tread_share[:], state.is_held[:] = 0.0, 0.0, 0.0
        state.lift[:], state.most[:], state.since[:], state.off[:] = 0.0, np.inf, np.inf, 0.0

    def look(self, position: np.ndarray, dt: float) -> None:
        """Take what the map knows around a place (3,) [m] when its time has come."""
        state = self._state
        if self.terrain is None:
            if not math.isinf(state.since[0]):
                self.reset()
            return
        state.since[0] += dt
        if state.since[0] < PERIOD - 0.5 * dt:
            return
        state.since[0] = 0.0
        state.first[:] = self.terrain.write_window(state.window, position)

    @property
    def is_broken(self) -> bool:
        """Whether the ground around is seen to have steps, or holes."""
        return bool(self._state.off[0] > _BROKEN)

    @property
    def most(self) -> float:
        """The speed that the ground ahead allows [m/s]; infinity where it says nothing."""
        return float(self._state.most[0])

    @property
    def tread(self) -> Plane | None:
        """What the feet stand on, as a plane's normal and frame; None where it is not seen."""
        if self.terrain is None:  # quicker than to ask for the share
            return None
        return self._state.tread if self._state.tread_share[0] > 0.0 else None


@jit
def seen_height(sight: np.ndarray, x: float, y: float) -> float:
    """Height of the map at a place [m], as feet feel it; NaN where it is unknown."""
    own = sight[0]
    i = int(math.floor(y / RESOLUTION) - own.first[1])
    j = int(math.floor(x / RESOLUTION) - own.first[0])
    if 0 <= i < CELLS and 0 <= j < CELLS:
        return float(own.window[i, j] + own.lift[0])
    return math.nan


@jit
def _relief(sight: np.ndarray, x: float, y: float, reach: int) -> tuple[float, float, int]:
    """Return the least and the greatest height of the cells around a place, and how many known."""
    least, most, count = math.inf, -math.inf, 0
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            z = seen_height(sight, x + j * RESOLUTION, y + i * RESOLUTION)
            if not math.isnan(z):
                least, most, count = min(least, z), max(most, z), count + 1
    return least, most, count


@jit
def survey(
    robot: np.ndarray, feet: np.ndarray, ground: np.ndarray, sight: np.ndarray, command: np.ndarray
) -> None:
    """Find, after each look, plane and treads, how far the map is off, and the speed allowed."""
    own = sight[0]
    if own.since[0] > 0.0:
        return
    _match(feet, sight)
    _fit_base(robot, ground, sight)
    _fit_treads(feet, ground, sight)
    own.most[0] = _speed_allowed(robot, sight, command)


@jit
def _match(feet: np.ndarray, sight: np.ndarray) -> None:
    """Follow by how much the feet that bear load are above the map where it is even."""
    legs, own = feet[0], sight[0]
    total, count = 0.0, 0
    for leg in range(4):
        if legs.is_loaded[leg]:
            x, y = legs.points[leg, 0], legs.points[leg, 1]
            z = seen_height(sight, x, y)
            least, most, known = _relief(sight, x, y, 1)
            if not math.isnan(z) and known >= 5 and most - least < 2.0 * _EVEN:
                off = legs.points[leg, 2] - z
                if abs(off) < _LIFTED:
                    total, count = total + off, count + 1
    if count > 0:
        own.lift[0] += min(PERIOD / _LIFT_TIME, 1.0) * total / count


@jit
def _fit_base(robot: np.ndarray, ground: np.ndarray, sight: np.ndarray) -> None:
    """Lead the plane that the base follows to the least squares of the ground around it."""
    base, blind, own = robot[0].base, ground[0], sight[0]
    bx, by, yaw = base.position[0], base.position[1], base.rpy[2]
    c, s = math.cos(yaw), math.sin(yaw)
    sums = np.zeros(10)  # n, x, y, z, xx, xy, yy, xz, yz, zz
    asked = 0
    level = height_at(blind, bx, by)
    steps = int((_BEFORE - _BEHIND) / RESOLUTION) + 1
    aside = int(_BESIDE / RESOLUTION)
    beyond = int(_BEYOND / RESOLUTION)
    row = np.empty(steps + 2 * beyond)
    for n in range(-aside, aside + 1):
        y = n * RESOLUTION
        for m in range(len(row)):
            x = _BEHIND + (m - beyond) * RESOLUTION
            row[m] = seen_height(sight, bx + c * x - s * y, by + s * x + c * y) - level
        for m in range(steps):
            x = _BEHIND + m * RESOLUTION
            asked += 1
            z = _closed(row, m + beyond)
            if math.isnan(z) or abs(z) > _DEEP + _STEEPEST * abs(x):
                continue
            sums[0] += 1.0
            sums[1] += x
            sums[2] += y
            sums[3] += z
            sums[4] += x * x
            sums[5] += x * y
            sums[6] += y * y
            sums[7] += x * z
            sums[8] += y * z
            sums[9] += z * z
    share = min(PERIOD / _TIME, 1.0)
    count = sums[0]
    gx, gy, height = blind.gradient[0], blind.gradient[1], level
    is_known = count >= _ENOUGH * asked
    if is_known:
        mx, my, mz = sums[1] / count, sums[2] / count, sums[3] / count
        xx, yy = sums[4] - count * mx * mx, sums[6] - count * my * my
        xy = sums[5] - count * mx * my
        xz, yz = sums[7] - count * mx * mz, sums[8] - count * my * mz
        determinant = xx * yy - xy * xy
        is_known = determinant > 1e-6 and xx > 0.02 * count
        if is_known:
            ahead, left = (yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant
            left_over = sums[9] - count * mz * mz - ahead * xz - left * yz
            own.off[0] = math.sqrt(max(left_over, 0.0) / count)
            size = math.hypot(ahead, left)
            if size > _STEEPEST:
                ahead, left = ahead * _STEEPEST / size, left * _STEEPEST / size
            height = level + mz - ahead * mx - left * my
            gx, gy = c * ahead - s * left, s * ahead + c * left
    if not is_known:
        own.off[0] = 0.0
    plane = own.plane
    if own.share[0] == 0.0:
        if not is_known:
            return
        for k in range(2):
            plane.gradient[k] = blind.gradient[k]
        now = level
    else:
        now = height_at(plane, bx, by)
    own.share[0] += share * ((1.0 if is_known else 0.0) - own.share[0])
    if not is_known and own.share[0] < 0.02:
        own.share[0] = 0.0
    plane.gradient[0] += share * (gx - plane.gradient[0])
    plane.gradient[1] += share * (gy - plane.gradient[1])
    plane.centre[0], plane.centre[1] = bx, by
    plane.height = now + share * (height - now)
    raise_frame(plane)


@jit
def _closed(row: np.ndarray, at: int) -> float:
    """Height in a row without gaps: the lower of the highest just behind and just ahead."""
    if math.isnan(row[at]):
        return math.nan
    behind = ahead = float(row[at])
    for k in range(1, _GAP + 1):
        if at - k >= 0 and row[at - k] > behind:
            behind = row[at - k]
        if at + k < len(row) and row[at + k] > ahead:
            ahead = row[at + k]
    return float(min(behind, ahead))


@jit
def _fit_treads(feet: np.ndarray, ground: np.ndarray, sight: np.ndarray) -> None:
    """Lead the plane of the treads to the mean slope of the ground around feet that stand."""
    legs, blind, own = feet[0], ground[0], sight[0]
    gx = gy = 0.0
    count = 0
    for leg in range(4):
        if not legs.is_loaded[leg]:
            continue
        px, py, pz = legs.points[leg, 0], legs.points[leg, 1], legs.points[leg, 2]
        n = mx = my = mz = xx = xy = yy = xz = yz = 0.0
        for i in range(-2, 3):
            for j in range(-2, 3):
                x, y = j * RESOLUTION, i * RESOLUTION
                z = seen_height(sight, px + x, py + y) - pz
                if abs(z) < _TREAD:
                    n, mx, my, mz = n + 1.0, mx + x, my + y, mz + z
                    xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
                    xz, yz = xz + x * z, yz + y * z
        if n < _CELLS_OF_TREAD:
            continue
        mx, my, mz = mx / n, my / n, mz / n
        xx, xy, yy = xx - n * mx * mx, xy - n * mx * my, yy - n * my * my
        xz, yz = xz - n * mx * mz, yz - n * my * mz
        # Of few cells, or such as lie in a row, the slope is doubtful: it is drawn to none.
        xx, yy = xx + 0.002, yy + 0.002
        determinant = xx * yy - xy * xy
        gx += (yy * xz - xy * yz) / determinant
        gy += (xx * yz - xy * xz) / determinant
        count += 1
    share = min(PERIOD / _TIME, 1.0)
    tread = own.tread
    is_known = count > 0
    if is_known:
        gx, gy = gx / count, gy / count
    elif own.share[0] > 0.5:
        return  # all feet in the air
    else:
        gx, gy = blind.gradient[0], blind.gradient[1]
    if own.tread_share[0] == 0.0:
        if not is_known:
            return
        tread.gradient[0], tread.gradient[1] = blind.gradient[0], blind.gradient[1]
    own.tread_share[0] += share * ((1.0 if is_known else 0.0) - own.tread_share[0])
    if not is_known and own.tread_share[0] < 0.02:
        own.tread_share[0] = 0.0
    tread.gradient[0] += share * (gx - tread.gradient[0])
    tread.gradient[1] += share * (gy - tread.gradient[1])
    raise_frame(tread)


@jit
def _speed_allowed(robot: np.ndarray, sight: np.ndarray, command: np.ndarray) -> float:
    """Return the speed [m/s] that edges in the way of a command (3,) allow."""
    speed = math.hypot(command[0], command[1])
    if speed < 1e-3:
        return math.inf
    base = robot[0].base
    yaw = base.rpy[2] + math.atan2(command[1], command[0])
    c, s = math.cos(yaw), math.sin(yaw)
    tallest = 0.0
    for m in range(int((_FARTHEST - _NEAR) / RESOLUTION)):
        found = 0
        edge = math.inf
        for n in range(-2, 3):
            x, y = _NEAR + m * RESOLUTION, 0.5 * n * _WIDE
            here = base.position[0] + c * x - s * y, base.position[1] + s * x + c * y
            least, most, count = _relief(sight, here[0], here[1], 1)
            if count >= 4:
                found += 1
                edge = min(edge, most - least)
        if found >= 3:
            tallest = max(tallest, edge)
    if tallest < _LOW:
        return math.inf
    share = min((tallest - _LOW) / (_TALL - _LOW), 1.0)
    return _SLOWEST + (1.0 - share) * 0.4


@jit
def find_seen_footholds(
    robot: np.ndarray,
    feet: np.ndarray,
    ground: np.ndarray,
    sight: np.ndarray,
    schedule: GaitState,
    asked: tuple[np.ndarray, np.ndarray, np.ndarray, float],
) -> None:
    """
    Move the landings of the feet in the air, and lift them over what lies between.

    `asked` are the points of lift-off (4, 3) [m], the heights of steps (4,) [m] and the shares of
    a swing (4,) after which feet are above where they land, both written where the map knows the
    way, and the foot's radius [m].
    """
    legs, own, plane = feet[0], sight[0], ground[0]
    lift_off, rises, arrivals, radius = asked
    if own.share[0] == 0.0:
        own.is_held[:] = 0.0  # else a leg would step back to it where the map begins again
        return
    is_new = own.since[0] == 0.0
    for leg in range(4):
        if schedule.is_stance[leg]:
            own.is_held[leg] = 0.0
            continue
        landing = legs.landing[leg]
        above = landing[2] - height_at(plane, landing[0], landing[1])
        if schedule.phase[leg] < _DECIDED and (is_new or own.is_held[leg] == 0.0):
            _choose(robot, plane, sight, (leg, schedule.phase[leg]), landing)
        if own.is_held[leg] == 2.0:
            landing[0], landing[1] = own.held[leg, 0], own.held[leg, 1]
            arrivals[leg] = _ARRIVAL
        z = seen_height(sight, landing[0], landing[1])
        if math.isnan(z) or abs(z - height_at(plane, landing[0], landing[1])) > 0.35:
            continue
        landing[2] = z + above
        top = _highest_between(sight, lift_off[leg], landing)
        if not math.isnan(top):
            ends = max(lift_off[leg, 2], landing[2])
            rises[leg] = max(top + radius + _CLEARANCE - ends, 0.05)


@jit
def _choose(
    robot: np.ndarray,
    plane: Plane,
    sight: np.ndarray,
    swing: tuple[int, float],
    landing: np.ndarray,
) -> None:
    """
    Choose a foothold near Raibert's, `landing`; 1 holds that, 2 another one.

    `swing` is the leg's number, and the share of its swing that is over.
    """
    leg, phase = swing
    own, yaw = sight[0], robot[0].base.rpy[2]
    if own.is_held[leg] != 2.0 and _cost_of_ground(sight, plane, landing[0], landing[1]) < _FREE:
        own.is_held[leg] = 1.0
        return
    c, s = math.cos(yaw), math.sin(yaw)
    least, best_x, best_y = math.inf, landing[0], landing[1]
    if own.is_held[leg] == 2.0:
        best_x, best_y = own.held[leg, 0], own.held[leg, 1]
    for m in range(-_AHEAD, _AHEAD + 1):
        for n in range(-_ASIDE, _ASIDE + 1):
            dx, dy = m * _APART, n * _APART
            x, y = landing[0] + c * dx - s * dy, landing[1] + s * dx + c * dy
            turned = 0.0
            if own.is_held[leg] == 2.0:
                turned = math.hypot(x - own.held[leg, 0], y - own.held[leg, 1])
                if turned > _TURNED * (1.0 - phase):
                    continue  # it would come down on the way there
            cost = _cost_of_ground(sight, plane, x, y) + _FAR * (dx * dx + dy * dy)
            cost += _HELD * turned
            if cost < least:
                least, best_x, best_y = cost, x, y
    own.is_held[leg] = 2.0
    own.held[leg, 0], own.held[leg, 1] = best_x, best_y


@jit
def _cost_of_ground(sight: np.ndarray, plane: Plane, x: float, y: float) -> float:
    """Return what ground costs to step on at a place: edges near it, depth, not to be known."""
    z = seen_height(sight, x, y)
    if math.isnan(z):
        return _UNKNOWN
    least, most, count = _relief(sight, x, y, 1)
    low, high, wide = _relief(sight, x, y, 2)
    off = z - height_at(plane, x, y)
    if off < -_DEEP or off > _HIGH:
        return 5.0 + _EDGE * (most - least)
    # Steep even ground has a height between its cells, too.
    steep = 2.0 * RESOLUTION * math.hypot(plane.gradient[0], plane.gradient[1])
    unknown = _DOUBT * max(8 - count, 0) + _DIM * max(23 - wide, 0)
    near = _EDGE * max(most - least - _EVEN - min(steep, 0.04), 0.0)
    far = _RING * max(high - low - _EVEN - min(2.0 * steep, 0.08), 0.0)
    return near + far + unknown


@jit
def _highest_between(sight: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Return the greatest height between two places; NaN where too little of it is known."""
    way = math.hypot(end[0] - start[0], end[1] - start[1])
    count = int(way / 0.02) + 2
    top, known = -math.inf, 0
    for k in range(count):
        part = k / (count - 1)
        x, y = start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])
        z = seen_height(sight, x, y)
        if not math.isnan(z):
            top, known = max(top, z), known + 1
    return top if known >= 0.6 * count else math.nan
