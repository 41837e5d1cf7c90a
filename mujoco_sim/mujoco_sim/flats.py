# SPDX-License-Identifier: Apache-2.0
"""
Flats for robots that drive through doors: rooms, a corridor, furniture, all of them boxes.

All is in the world frame [m], [rad], and the robot starts at its origin. The same seed gives the
same flat.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

WALL_THICKNESS = 0.1
# Higher than a lidar on the back of a Go2 that walks [m], also where the ray has sunk or risen.
WALL_HEIGHT = 0.8
# Furniture: higher than such a lidar, so that it sees what its feet must not meet.
LEAST_HEIGHT, MOST_HEIGHT = 0.55, 0.8
LEAST_DOOR, MOST_DOOR = 0.9, 1.1
# Nothing stands nearer to the middle of a way from door to door.
LANE = 0.5
# Two robots side by side are put so far apart, half of it; what is free around each.
START_REACH, START_FREE = 0.6, 0.7
CORNER = 0.15  # from the corner of a room to the next door
# How often it is tried to find a place for a piece of furniture.
TRIES = 12
# (length along the wall, depth) of a piece at a wall: shelf, cupboard, desk, sofa, bed.
AT_WALL = ((0.8, 0.3), (1.0, 0.5), (1.2, 0.6), (1.8, 0.8), (1.9, 1.4))
# One that stands free: stool, table, long table.
FREE = ((0.4, 0.4), (0.8, 0.8), (1.3, 0.8))
# Length and width of a flat, widths of what is in it.
LENGTHS, WIDTHS = (10.0, 16.0), (8.0, 12.0)
CORRIDOR, LEAST_ROOM, MOST_ROOM, LIVING = (1.3, 1.8), 2.7, 4.6, (3.2, 4.6)


@dataclass(frozen=True)
class Flat:
    """
    A flat and the places of its parts.

    `boxes`, shape (n, 6): centre x, y, half length, half width, height, yaw; they stand on the
    floor, the first `walls` of them are walls, the others furniture. `rooms`, shape (r, 4): least
    x, y, greatest x, y, walls included to their middle; the corridor is one. `doors`, shape
    (d, 4): centre x, y, width, yaw of the wall that they are in. `corner`, shape (2,), is the
    least x and y of all, `size`, shape (2,), its length and width.
    """

    boxes: np.ndarray
    walls: int
    rooms: np.ndarray
    doors: np.ndarray
    corner: np.ndarray
    size: np.ndarray


def make_flat(seed: int) -> Flat:
    """Return the flat of a seed: a corridor with rooms on both sides, maybe one at its end."""
    random = np.random.default_rng((seed, 16))
    length, width = random.uniform(*LENGTHS), random.uniform(*WIDTHS)
    living = random.uniform(*LIVING) if random.random() < 0.7 else 0.0
    across = random.uniform(*CORRIDOR)
    below = random.uniform(0.38, 0.5) * (width - across)
    end, above = length - living, below + across
    rooms = [(0.0, below, end, above)]
    for low, high in ((0.0, below), (above, width)):
        edges = _split(end, random)
        rooms += [(a, low, b, high) for a, b in zip(edges, edges[1:], strict=False)]
    if living:
        rooms.append((end, 0.0, length, width))
    plan = _turned(np.array(rooms), random)
    return _built(plan, 1, random)


def make_office() -> Flat:
    """Return the office: a ring of corridors around rooms in the middle, rooms outside."""
    xs, ys = (0.0, 4.6, 6.2, 11.0, 16.4, 18.0, 23.0), (0.0, 4.0, 5.6, 9.4, 11.0, 15.0)
    west, inner, east, end = xs[1], xs[2], xs[4], xs[5]
    ring = [(west, ys[1], end, ys[2]), (west, ys[3], end, ys[4])]
    ring += [(west, ys[2], inner, ys[3]), (east, ys[2], end, ys[3])]
    rooms = [(inner, ys[2], xs[3], ys[3]), (xs[3], ys[2], east, ys[3])]
    for low, high, edges in (
        (ys[0], ys[1], (0.0, 4.6, 8.4, 13.2, 18.0, 23.0)),
        (ys[4], ys[5], (0.0, 3.4, 9.6, 14.0, 19.0, 23.0)),
    ):
        rooms += [(a, low, b, high) for a, b in zip(edges, edges[1:], strict=False)]
    rooms += [(0.0, ys[1], west, 7.9), (0.0, 7.9, west, ys[4])]
    rooms += [(end, ys[1], xs[6], 6.8), (end, 6.8, xs[6], ys[4])]
    random = np.random.default_rng(16)
    plan = np.array(ring + rooms)
    return _built(plan, len(ring), random)


def _split(end: float, random: np.random.Generator) -> list[float]:
    """Return where the walls of a row of rooms are, from 0 to `end` [m]."""
    fewest, most = math.ceil(end / MOST_ROOM), math.floor(end / LEAST_ROOM)
    count = int(random.integers(fewest, most + 1))
    spare = random.dirichlet(np.full(count, 2.0)) * (end - count * LEAST_ROOM)
    return [0.0, *np.cumsum(LEAST_ROOM + spare)[:-1].tolist(), end]


def _turned(rooms: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return rooms turned by quarters and mirrored: the corridor does not always lie along x."""
    for axis in (0, 1):
        if random.random() < 0.5:
            rooms[:, [axis, axis + 2]] = -rooms[:, [axis + 2, axis]]
    return rooms[:, [1, 0, 3, 2]] if random.random() < 0.5 else rooms


class _Wall(NamedTuple):
    """A wall: the axis that is constant along it, its value, and where it begins and ends [m]."""

    axis: int
    value: float
    low: float
    high: float


def _shared(first: np.ndarray, second: np.ndarray) -> _Wall | None:
    """Return the wall that two rooms share, if they do."""
    for axis, other in ((0, 1), (1, 0)):
        for a, b in ((first, second), (second, first)):
            low, high = max(a[other], b[other]), min(a[other + 2], b[other + 2])
            if a[axis + 2] == b[axis] and high > low:
                return _Wall(axis, float(b[axis]), float(low), float(high))
    return None


def _choose_doors(
    rooms: np.ndarray, corridors: int, random: np.random.Generator
) -> dict[tuple[int, int], np.ndarray]:
    """
    Return doors as `Flat` has them, by the two rooms that they join.

    The first rooms, `corridors` of them, are corridors: each has a door to each of its neighbours.
    Some other neighbours have a door; at least one of these doors closes a loop. A room that
    would stay without a way gets a door.
    """
    doors: dict[tuple[int, int], np.ndarray] = {}
    joined = list(range(len(rooms)))  # equal for rooms that doors join
    looped = False
    pairs = [(a, b) for b in range(len(rooms)) for a in range(b)]
    for is_left_out in (False, True):
        for a, b in pairs:
            wall = _shared(rooms[a], rooms[b])
            known = joined[a] == joined[b]
            if wall is None or (a, b) in doors or (is_left_out and known):
                continue
            wanted = a < corridors or is_left_out or random.random() < 0.4
            if not wanted and (looped or not known):
                continue
            door = _door(wall, random, b < corridors)
            if door is None:
                continue
            doors[a, b] = door
            looped = looped or (known and a >= corridors)
            joined = [joined[a] if group == joined[b] else group for group in joined]
    return doors


def _door(wall: _Wall, random: np.random.Generator, is_open: bool) -> np.ndarray | None:
    """Return a door somewhere in a wall, or all of the wall; None where there is no space."""
    axis, value, low, high = wall
    width = random.uniform(LEAST_DOOR, MOST_DOOR)
    margin = 0.5 * (WALL_THICKNESS + width) + CORNER
    if high - low < 2.0 * margin:
        return None
    middle = random.uniform(low + margin, high - margin)
    if is_open:
        width, middle = high - low - WALL_THICKNESS, 0.5 * (low + high)
    place = (value, middle) if axis == 0 else (middle, value)
    return np.array((*place, width, 0.5 * math.pi if axis == 0 else 0.0))


def _built(rooms: np.ndarray, corridors: int, random: np.random.Generator) -> Flat:
    """Return rooms, of which the first are corridors, with doors, walls and furniture."""
    sides = rooms[:, 2:] - rooms[:, :2]
    start = int(np.argmax(sides[corridors:].min(axis=1))) + corridors
    # To the millimetre: walls of two rooms on one line are then found to be.
    rooms = np.round(rooms - np.tile(0.5 * (rooms[start, :2] + rooms[start, 2:]), 2), 3)
    doors = _choose_doors(rooms, corridors, random)
    walls = _walls(rooms, np.array(list(doors.values())))
    furniture: list[np.ndarray] = []
    for index, room in enumerate(rooms):
        own = np.array([door for pair, door in doors.items() if index in pair])
        furniture += _furnish(room, _keep_free(room, own, index, corridors, start), random)
    corner = rooms[:, :2].min(axis=0) - 0.5 * WALL_THICKNESS
    return Flat(
        boxes=np.array(walls + furniture),
        walls=len(walls),
        rooms=rooms,
        doors=np.array(list(doors.values())),
        corner=corner,
        size=rooms[:, 2:].max(axis=0) + 0.5 * WALL_THICKNESS - corner,
    )


def _walls(rooms: np.ndarray, doors: np.ndarray) -> list[np.ndarray]:
    """Return the walls around rooms as boxes, shape (6,) each, with gaps for the doors."""
    sides: dict[tuple[int, float], list[tuple[float, float]]] = {}
    for room in rooms:
        for axis in (0, 1):
            along = (float(room[1 - axis]), float(room[3 - axis]))
            for value in (room[axis], room[axis + 2]):
                sides.setdefault((axis, float(value)), []).append(along)
    half = 0.5 * WALL_THICKNESS
    boxes = []
    for (axis, value), pieces in sorted(sides.items()):
        here = [
            (float(door[1 - axis] - 0.5 * door[2]), float(door[1 - axis] + 0.5 * door[2]))
            for door in doors
            if door[axis] == value and (door[3] > 0.0) == (axis == 0)
        ]
        for low, high in _without(_joined(pieces, half), sorted(here)):
            place, size = [value, 0.5 * (low + high)], [half, 0.5 * (high - low)]
            if axis == 1:
                place, size = place[::-1], size[::-1]
            boxes.append(np.array((*place, *size, WALL_HEIGHT, 0.0)))
    return boxes


def _joined(pieces: list[tuple[float, float]], margin: float) -> list[tuple[float, float]]:
    """Return what intervals cover together, `margin` more at both ends."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted((low - margin, high + margin) for low, high in pieces):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return joined


def _without(
    pieces: list[tuple[float, float]], gaps: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return intervals without the gaps, which are sorted and do not overlap."""
    left = []
    for low, high in pieces:
        for begin, end in gaps:
            if low < begin < high:
                left.append((low, begin))
                low = end
        left.append((low, high))
    return left


def _keep_free(
    room: np.ndarray, doors: np.ndarray, index: int, corridors: int, start: int
) -> np.ndarray:
    """
    Return discs (x, y, radius) [m], shape (n, 3), where no furniture may stand in a room.

    They follow ways from each door, at first straight, to the middle of a room or of a corridor,
    which is free along its length; and they cover where robots start.
    """
    middle = 0.5 * (room[:2] + room[2:])
    long = int(np.argmax(room[2:] - room[:2]))
    ways = []
    for door in doors:
        inside = door[:2].copy()
        across = 0 if door[3] > 0.0 else 1
        inside[across] += math.copysign(0.6, middle[across] - door[across])
        goal = middle.copy()
        if index < corridors:
            goal[long] = inside[long]
        ways += [(door[:2], inside), (inside, goal)]
    if index < corridors:
        ends = np.stack((middle, middle))
        ends[:, long] = room[long], room[long + 2]
        ways.append((ends[0], ends[1]))
    share = np.linspace(0.0, 1.0, 40)[:, None]
    points = np.concatenate([(1.0 - share) * a + share * b for a, b in ways])
    discs = np.column_stack((points, np.full(len(points), LANE)))
    if index == start:
        robots = [(0.0, y, START_FREE) for y in np.linspace(-START_REACH, START_REACH, 7)]
        discs = np.concatenate((discs, robots))
    return discs


def _furnish(room: np.ndarray, free: np.ndarray, random: np.random.Generator) -> list[np.ndarray]:
    """Return furniture of a room as boxes, shape (6,) each, that keep off the discs `free`."""
    sides = room[2:] - room[:2] - WALL_THICKNESS
    pieces: list[np.ndarray] = []
    for _ in range(round(float(sides.prod()) / 2.5)):
        for _ in range(TRIES):
            stands_free = random.random() < 0.25
            piece = _piece(room, sides, stands_free, random)
            if _fits(piece, room, free, pieces):
                pieces.append(piece)
                break
    return pieces


def _piece(
    room: np.ndarray, sides: np.ndarray, stands_free: bool, random: np.random.Generator
) -> np.ndarray:
    """Return a piece of furniture somewhere in a room, at a wall or free."""
    kinds = FREE if stands_free else AT_WALL
    along, depth = np.array(kinds[random.integers(len(kinds))]) * random.uniform(0.85, 1.15)
    place = room[:2] + 0.5 * WALL_THICKNESS + random.uniform(size=2) * sides
    yaw = random.uniform(-0.5 * math.pi, 0.5 * math.pi)
    if not stands_free:
        axis, is_far = int(random.integers(2)), bool(random.integers(2))
        away = 0.5 * (WALL_THICKNESS + depth) + 0.02
        place[axis] = room[axis + 2] - away if is_far else room[axis] + away
        yaw = 0.5 * math.pi if axis == 0 else 0.0
    height = random.uniform(LEAST_HEIGHT, MOST_HEIGHT)
    return np.array((*place, 0.5 * along, 0.5 * depth, height, yaw))


def _fits(piece: np.ndarray, room: np.ndarray, free: np.ndarray, others: list[np.ndarray]) -> bool:
    """Whether a piece is inside a room, off the discs (x, y, radius), and in no other piece."""
    corners = _corners(piece)
    margin = 0.5 * WALL_THICKNESS + 0.01
    if (corners < room[:2] + margin).any() or (corners > room[2:] - margin).any():
        return False
    axes = _axes(piece)
    off = np.maximum(np.abs((free[:, :2] - piece[:2]) @ axes.T) - piece[2:4], 0.0)
    if (np.hypot(off[:, 0], off[:, 1]) < free[:, 2]).any():
        return False
    return not any(_overlap(corners, axes, other) for other in others)


def _overlap(corners: np.ndarray, axes: np.ndarray, other: np.ndarray) -> bool:
    """Whether two rectangles overlap: none of their axes separates them, with 5 cm between."""
    theirs = _corners(other)
    for axis in (*axes, *_axes(other)):
        ours_along, theirs_along = corners @ axis, theirs @ axis
        if (
            ours_along.max() + 0.05 < theirs_along.min()
            or theirs_along.max() + 0.05 < ours_along.min()
        ):
            return False
    return True


def _axes(box: np.ndarray) -> np.ndarray:
    """Return the axes of a box in the plane, one a row, shape (2, 2)."""
    cos, sin = math.cos(box[5]), math.sin(box[5])
    return np.array(((cos, sin), (-sin, cos)))


def _corners(box: np.ndarray) -> np.ndarray:
    """Return the corners of a box in the plane [m], shape (4, 2)."""
    signs = np.array(((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)))
    corners: np.ndarray = box[:2] + (signs * box[2:4]) @ _axes(box)
    return corners
