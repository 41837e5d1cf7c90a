# SPDX-License-Identifier: Apache-2.0
"""A map of surfaces around a place, and the pose from which a scan fits it best."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.mapping.occupancy import OCCUPIED_FROM
from wasd_navigation.se2 import invert

CELL = 0.10  # [m]
# Surfaces within this distance of a point tell where it should be [m].
REACH = 0.15
# Surfaces that face apart by more than this are not the same: cosine of the angle.
LEAST_COSINE = 0.7
# What is farther than this behind what is occupied contradicts the map [m].
BEHIND = 0.2
# One in so many points counts until the pose has settled so far [m], [rad]; then all do.
COARSE, SETTLED = 4, 1e-3
# What seems told where nothing is, as a share of the most that is told; a turn as a way [m].
SPURIOUS, ARM = 0.003, 3.0
# Most surfaces that are kept.
CAPACITY = 40_000


class LocalMap(NamedTuple):
    """
    Surfaces by cells: up to two in each, which face different ways, as the two sides of a door.

    `slots`, shape (rows, columns, 2), has their row in `sums`, shape (n, 5), or -1: weight of
    points, their mean x, y [m] and the direction of their normals nx, ny, (0, 0) of a post (while
    points are added: the sums of these). `origin`, shape (2,), is the corner of
    the first cell, `used`, shape (1,), the number of rows in use.
    """

    slots: np.ndarray
    sums: np.ndarray
    origin: np.ndarray
    used: np.ndarray

    def clear(self, middle: np.ndarray) -> None:
        """Forget all, and lie around a place [m], shape (2,)."""
        self.slots.fill(-1)
        self.used[0] = 0
        half = 0.5 * CELL * self.slots.shape[0]
        self.origin[:] = np.floor((middle - half) / CELL) * CELL


def make_local_map(half_side: float, capacity: int = CAPACITY) -> LocalMap:
    """Return an empty map that reaches so far from its middle [m], of so many surfaces at most."""
    cells = 2 * math.ceil(half_side / CELL)
    return LocalMap(
        np.full((cells, cells, 2), -1, dtype=np.int32),
        np.zeros((capacity, 5)),
        np.zeros(2),
        np.zeros(1, dtype=np.int64),
    )


@jit
def add_surfaces(
    local: LocalMap,
    poses: np.ndarray,
    surfaces: np.ndarray,
    begins: np.ndarray,
) -> None:
    """
    Put into an empty map what was seen from some places, at poses, shape (n, 3).

    `surfaces`, shape (m, 5), has x, y, nx, ny and the deviation of each in the frame of their
    place, those of place i from begins[i] to begins[i + 1].
    """
    for number in range(poses.shape[0]):
        _add_surface(local, poses[number], surfaces[begins[number] : begins[number + 1]])
    for row in range(local.used[0]):
        sums = local.sums[row]
        length = math.hypot(sums[3], sums[4])
        sums[1] /= sums[0]
        sums[2] /= sums[0]
        if length > 0.0:
            sums[3] /= length
            sums[4] /= length


@jit
def _add_surface(local: LocalMap, pose: np.ndarray, surface: np.ndarray) -> None:
    """Add the sums of what was seen from a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    rows, columns = local.slots.shape[:2]
    for point in range(surface.shape[0]):
        px, py, ax, ay, deviation = surface[point]
        weight = 1.0 / (deviation * deviation)
        x, y = pose[0] + cos * px - sin * py, pose[1] + sin * px + cos * py
        nx, ny = cos * ax - sin * ay, sin * ax + cos * ay
        row = int(math.floor((y - local.origin[1]) / CELL))
        column = int(math.floor((x - local.origin[0]) / CELL))
        if row < 0 or column < 0 or row >= rows or column >= columns:
            continue
        for slot in range(2):
            at = local.slots[row, column, slot]
            if at < 0:
                if local.used[0] >= local.sums.shape[0]:
                    break
                at = local.used[0]
                local.used[0] += 1
                local.slots[row, column, slot] = at
                for i in range(5):
                    local.sums[at, i] = 0.0
            sums = local.sums[at]
            size = math.sqrt(sums[3] * sums[3] + sums[4] * sums[4])  # hypot takes far longer
            is_new, is_post = sums[0] == 0.0, nx == 0.0 and ny == 0.0
            if is_new or (is_post and size == 0.0) or nx * sums[3] + ny * sums[4] > 0.5 * size:
                sums[0] += weight
                sums[1] += weight * x
                sums[2] += weight * y
                sums[3] += weight * nx
                sums[4] += weight * ny
                break


class Fit(NamedTuple):
    """
    How a scan fits: its pose, and how well it is known.

    `information`, shape (3, 3), of x, y [1/m^2] and yaw [1/rad^2], is what the scan alone tells;
    `share` is that of the points which lie on a surface of the map, [0, 1].
    """

    pose: np.ndarray
    information: np.ndarray
    share: float


@jit
def _nearest(local: LocalMap, at: np.ndarray, facing: np.ndarray, out: np.ndarray) -> bool:
    """
    Write (distance, nx, ny) of a point off the surface that faces as it does; False if none is.

    The surface is the implicit moving least squares of [Deschaud2018]: a mean of the
    planes around, near ones more.
    """
    row = int(math.floor((at[1] - local.origin[1]) / CELL))
    column = int(math.floor((at[0] - local.origin[0]) / CELL))
    rows, columns = local.slots.shape[:2]
    if row < 1 or column < 1 or row >= rows - 1 or column >= columns - 1:
        return False
    total, distance, nx, ny = 0.0, 0.0, 0.0, 0.0
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            for slot in range(2):
                index = local.slots[r, c, slot]
                if index < 0:
                    break
                n, x, y, ax, ay = local.sums[index]
                if ax * facing[0] + ay * facing[1] < LEAST_COSINE:
                    continue
                dx, dy = at[0] - x, at[1] - y
                share = 1.0 - (dx * dx + dy * dy) / (REACH * REACH)
                if share <= 0.0:
                    continue
                weight = n * share * share
                total += weight
                distance += weight * (ax * dx + ay * dy)
                nx += weight * ax
                ny += weight * ay
    if total <= 0.0:
        return False
    length = math.hypot(nx, ny)
    out[0], out[1], out[2] = distance / total, nx / length, ny / length
    return True


@jit
def _nearest_post(local: LocalMap, at: np.ndarray, out: np.ndarray) -> bool:
    """Write the way to a point from the post that is near; False if none is."""
    row = int(math.floor((at[1] - local.origin[1]) / CELL))
    column = int(math.floor((at[0] - local.origin[0]) / CELL))
    rows, columns = local.slots.shape[:2]
    if row < 1 or column < 1 or row >= rows - 1 or column >= columns - 1:
        return False
    total, x, y = 0.0, 0.0, 0.0
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            for slot in range(2):
                index = local.slots[r, c, slot]
                if index < 0:
                    break
                n, px, py, ax, ay = local.sums[index]
                if ax != 0.0 or ay != 0.0:
                    continue
                dx, dy = at[0] - px, at[1] - py
                if dx * dx + dy * dy < REACH * REACH:
                    total += n
                    x += n * dx
                    y += n * dy
    if total <= 0.0:
        return False
    out[0], out[1] = x / total, y / total
    return True


@jit
def fit_scan(
    local: LocalMap,
    surface: np.ndarray,
    start: np.ndarray,
    prior: np.ndarray,
    noise: float,
    rounds: int,
) -> Fit:
    """
    Return where a scan's surface, shape (m, 5), fits the map, near `start`.

    Gauss-Newton on distances from point to surface, or from post to post, of each point's
    standard deviation or of `noise` [m] where that is more, with Cauchy's weights, and on the
    distance from `start`, of information `prior`, shape (3, 3).
    """
    pose, away, step = start.copy(), np.empty(3), np.empty(3)
    information, gradient, inside = np.zeros((3, 3)), np.zeros(3), 0
    known = np.empty((3, 3))
    stride = COARSE
    for turn in range(rounds):
        if turn == rounds - 1:
            stride = 1
        inside = weigh_points(local, surface[::stride], pose, noise, (information, gradient))
        for i in range(3):
            away[i] = pose[i] - start[i]
        away[2] = (away[2] + math.pi) % (2.0 * math.pi) - math.pi
        for i in range(3):
            gradient[i] *= stride
            for j in range(3):
                information[i, j] *= stride
        _weaken(information, gradient)
        for i in range(3):
            for j in range(3):
                known[i, j] = information[i, j] + prior[i, j]
                gradient[i] += prior[i, j] * away[j]
        inverted = invert(known)
        for i in range(3):
            step[i] = 0.0
            for j in range(3):
                step[i] += inverted[i, j] * gradient[j]
            pose[i] -= step[i]
        if abs(step[0]) + abs(step[1]) < SETTLED and abs(step[2]) < SETTLED:
            if stride == 1:
                break
            stride = 1
    pose[2] = (pose[2] + math.pi) % (2.0 * math.pi) - math.pi
    return Fit(pose, information, inside / max(1, surface.shape[0]))


@jit
def _weaken(information: np.ndarray, gradient: np.ndarray) -> None:
    """
    Remove information that a scan only seems to give: along walls, around a round room.

    Normals are off by some degrees: of what is told in the best known direction, with turns as
    ways of `ARM`, so much, `SPURIOUS`, seems told in any other.
    """
    A, V = np.empty((3, 3)), np.eye(3)
    for i in range(3):
        for j in range(3):
            A[i, j] = information[i, j] / ((ARM if i == 2 else 1.0) * (ARM if j == 2 else 1.0))
    _diagonalise(A, V)
    most = max(A[0, 0], max(A[1, 1], A[2, 2]))
    if not most > 0.0:
        return
    told = np.zeros(3)
    for k in range(3):
        kept = max(0.0, 1.0 - SPURIOUS * most / max(A[k, k], 1e-12 * most))
        for i in range(3):
            told[k] += V[i, k] * gradient[i] / (ARM if i == 2 else 1.0)
        told[k] *= kept
        A[k, k] *= kept
    for i in range(3):
        arm = ARM if i == 2 else 1.0
        gradient[i] = 0.0
        for k in range(3):
            gradient[i] += arm * V[i, k] * told[k]
        for j in range(3):
            information[i, j] = 0.0
            for k in range(3):
                information[i, j] += arm * V[i, k] * A[k, k] * V[j, k] * (ARM if j == 2 else 1.0)


@jit
def _diagonalise(A: np.ndarray, V: np.ndarray) -> None:
    """Turn a symmetric matrix, shape (3, 3), to its axes, and V with it, by Jacobi's rotations."""
    for _ in range(6):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if abs(A[p, q]) < 1e-12 * (abs(A[p, p]) + abs(A[q, q])):
                continue
            angle = 0.5 * math.atan2(2.0 * A[p, q], A[p, p] - A[q, q])
            cos, sin = math.cos(angle), math.sin(angle)
            for k in range(3):
                first, second = A[k, p], A[k, q]
                A[k, p], A[k, q] = cos * first + sin * second, cos * second - sin * first
            for k in range(3):
                first, second = A[p, k], A[q, k]
                A[p, k], A[q, k] = cos * first + sin * second, cos * second - sin * first
            for k in range(3):
                first, second = V[k, p], V[k, q]
                V[k, p], V[k, q] = cos * first + sin * second, cos * second - sin * first


@jit
def weigh_points(
    local: LocalMap,
    surface: np.ndarray,
    pose: np.ndarray,
    noise: float,
    out: tuple[np.ndarray, np.ndarray],
) -> int:
    """Write information and gradient of all points at a pose; return how many are on a surface."""
    information, gradient = out
    inside = 0
    for i in range(3):
        gradient[i] = 0.0
        for j in range(3):
            information[i, j] = 0.0
    found, at, facing, jacobian = np.empty(3), np.empty(2), np.empty(2), np.empty(3)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for point in range(surface.shape[0]):
        px, py, ax, ay, deviation = surface[point]
        rx, ry = cos * px - sin * py, sin * px + cos * py
        at[0], at[1] = pose[0] + rx, pose[1] + ry
        facing[0], facing[1] = cos * ax - sin * ay, sin * ax + cos * ay
        deviation = max(deviation, noise)
        if ax == 0.0 and ay == 0.0:
            if not _nearest_post(local, at, found):
                continue
            square = (found[0] * found[0] + found[1] * found[1]) / (deviation * deviation)
            inside += square < 9.0
            weight = 1.0 / (1.0 + square / 4.0) / (deviation * deviation)
            for axis in range(2):
                jacobian[0], jacobian[1] = 1.0 - axis, float(axis)
                jacobian[2] = rx if axis == 1 else -ry
                for i in range(3):
                    gradient[i] += weight * jacobian[i] * found[axis]
                    for j in range(3):
                        information[i, j] += weight * jacobian[i] * jacobian[j]
            continue
        if not _nearest(local, at, facing, found):
            continue
        error = found[0] / deviation
        inside += abs(error) < 3.0
        weight = 1.0 / (1.0 + error * error / 4.0) / (deviation * deviation)
        jacobian[0], jacobian[1] = found[1], found[2]
        jacobian[2] = found[2] * rx - found[1] * ry
        for i in range(3):
            gradient[i] += weight * jacobian[i] * found[0]
            for j in range(3):
                information[i, j] += weight * jacobian[i] * jacobian[j]
    return inside


@jit
def count_fitting(
    local: LocalMap,
    surface: np.ndarray,
    pose: np.ndarray,
    noise: float,
    odds: np.ndarray,
    frame: tuple[float, int, int],
) -> tuple[int, int, int]:
    """
    Return how many points fit at a pose, and of the others how many are where nothing is known.

    First of these those in sight, then those behind what is occupied: seen through a wall, or
    through a door that was opened.
    `odds` are those of cells, 0 where nothing is known; `frame` is as of `Canvas.odds`.
    """
    fits = new = behind = 0
    out = np.zeros((3, 3)), np.zeros(3)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for index in range(surface.shape[0]):
        if weigh_points(local, surface[index : index + 1], pose, noise, out):
            fits += 1
            continue
        x = pose[0] + cos * surface[index, 0] - sin * surface[index, 1]
        y = pose[1] + sin * surface[index, 0] + cos * surface[index, 1]
        column = int(math.floor(x / frame[0])) - frame[1]
        row = int(math.floor(y / frame[0])) - frame[2]
        is_new = False
        for r in range(row - 1, row + 2):
            for c in range(column - 1, column + 2):
                inside = 0 <= r < odds.shape[0] and 0 <= c < odds.shape[1]
                is_new = is_new or not inside or odds[r, c] >= 0.0
        if is_new:
            is_behind = _is_behind(x, y, pose, odds, frame)
            behind, new = behind + is_behind, new + (not is_behind)
    return fits, new, behind


@jit
def _is_behind(
    x: float, y: float, pose: np.ndarray, odds: np.ndarray, frame: tuple[float, int, int]
) -> bool:
    """Return whether a point [m] is behind what is occupied, as seen from a pose."""
    way = math.hypot(x - pose[0], y - pose[1])
    for step in range(int((way - BEHIND) / frame[0])):
        share = step * frame[0] / way
        column = int(math.floor((pose[0] + share * (x - pose[0])) / frame[0])) - frame[1]
        row = int(math.floor((pose[1] + share * (y - pose[1])) / frame[0])) - frame[2]
        inside = 0 <= row < odds.shape[0] and 0 <= column < odds.shape[1]
        if inside and odds[row, column] > OCCUPIED_FROM:
            return True
    return False
