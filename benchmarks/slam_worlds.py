# SPDX-License-Identifier: Apache-2.0
"""Places where a planar lidar sees little to hold on to; the robot starts at their origin."""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

from mujoco_sim.flats import Flat, make_flat
import numpy as np
from slam_logs import drive, follow

HALF, HEIGHT = 0.05, 0.8  # of walls [m]
LEG = 0.025  # half the width of the leg of a table [m]
STEP = 0.05  # between the points of a given way [m]


def _flat(boxes: Sequence[tuple[float, ...]], corner: tuple[float, float]) -> Flat:
    """Return boxes (x, y, half length, half width, yaw) as a flat of one room."""
    low, none = np.array(corner), np.zeros((0, 4))
    rows = np.array([(*box[:4], HEIGHT, box[4]) for box in boxes])
    return Flat(rows, len(rows), none, none, low, -2.0 * low)


def _around(x: float, y: float) -> list[tuple[float, ...]]:
    """Return four walls, whose inner sides are so far from the origin [m]."""
    return [
        *((side * (x + HALF), 0.0, HALF, y + 2.0 * HALF, 0.0) for side in (-1.0, 1.0)),
        *((0.0, side * (y + HALF), x, HALF, 0.0) for side in (-1.0, 1.0)),
    ]


def make_corridor(seed: int) -> Flat:
    """Return a corridor of 30 m by 2 m with nothing in it."""
    return _flat(_around(15.0, 1.0), (-15.1, -1.1))


def make_round_room(seed: int) -> Flat:
    """Return a round room, 8 m across, its wall of 64 straight pieces."""
    radius, count = 4.0 + HALF, 64
    half = radius * math.tan(math.pi / count)
    angles = 2.0 * math.pi * np.arange(count) / count
    boxes = [(radius * math.cos(a), radius * math.sin(a), HALF, half, float(a)) for a in angles]
    return _flat(boxes, (-4.1, -4.1))


def make_block(seed: int) -> Flat:
    """Return a corridor of 2 m around a block: 60 m along its middle; the origin is on that."""
    shifted = [(x + 7.5, *rest) for x, *rest in _around(8.5, 8.5)]
    return _flat([*shifted, (7.5, 0.0, 6.5, 6.5, 0.0)], (-1.1, -8.6))


def make_office_of_legs(seed: int) -> Flat:
    """Return a hall of 20 m by 16 m with 30 tables, of which a lidar sees the legs."""
    random = np.random.default_rng((seed, 8))
    boxes, places = _around(10.0, 8.0), [(0.0, 0.0)]
    while len(places) < 31:
        x, y = random.uniform(-8.8, 8.8), random.uniform(-6.8, 6.8)
        if min(math.hypot(x - a, y - b) for a, b in places) < 2.1:
            continue
        places.append((x, y))
        turn = random.uniform(0.0, math.pi)
        cos, sin = math.cos(turn), math.sin(turn)
        for along, across in ((0.6, 0.35), (0.6, -0.35), (-0.6, 0.35), (-0.6, -0.35)):
            legs = (x + cos * along - sin * across, y + sin * along + cos * across)
            boxes.append((*legs, LEG, LEG, turn))
    return _flat(boxes, (-10.1, -8.1))


class EqualRooms(NamedTuple):
    """Two rooms that are equal, side by side, and a corridor before both that is not."""

    flat: Flat
    middles: np.ndarray  # of the rooms, shape (2, 2) [m]; the first is the origin
    size: tuple[float, float]  # of each [m]
    corridor: float  # y of its middle [m]
    ends: tuple[float, float]  # x of the corridor's ends [m]


def make_equal_rooms(seed: int) -> EqualRooms:
    """Return two rooms with the same things in them, their doors and a corridor."""
    random = np.random.default_rng((seed, 9))
    width, depth = random.uniform(3.2, 4.5), random.uniform(3.0, 4.0)
    wide, door = 1.6, 0.5  # of the corridor, and half of a door [m]
    step = width + 2.0 * HALF
    low, high = -0.5 * width, step + 0.5 * width
    front, back = -0.5 * depth, 0.5 * depth
    bottom = front - 2.0 * HALF - wide
    at = random.uniform(-0.2, 0.2) * width  # of the door
    shelf, chest = random.uniform(-0.3, 0.3) * width, random.uniform(-0.1, 0.3) * depth
    boxes = [(0.5 * step, 0.0, HALF, 0.5 * depth, 0.0)]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    boxes += [(middle, y, half + 2.0 * HALF, HALF, 0.0) for y in (back + HALF, bottom - HALF)]
    y, long = 0.5 * (back + bottom), 0.5 * (back - bottom)
    boxes += [(x, y, HALF, long, 0.0) for x in (low - HALF, high + HALF)]
    for x in (0.0, step):
        left, right = x - 0.5 * width - HALF, x + 0.5 * width + HALF
        for begin, end in ((left, x + at - door), (x + at + door, right)):
            boxes.append((0.5 * (begin + end), front - HALF, 0.5 * (end - begin), HALF, 0.0))
        boxes.append((x + shelf, back - 0.15, 0.4, 0.15, 0.0))
        boxes.append((x - 0.5 * width + 0.2, chest, 0.2, 0.3, 0.0))
    boxes.append((low + 0.2, front - 2.0 * HALF - 0.3, 0.2, 0.3, 0.0))  # at one end only
    flat = _flat(boxes, (low - 0.1, bottom - 0.1))
    flat = Flat(**{**vars(flat), 'size': np.array((high - low + 0.2, back - bottom + 0.2))})
    middles = np.array(((0.0, 0.0), (step, 0.0)))
    return EqualRooms(flat, middles + (at, 0.0), (width, depth), bottom + 0.5 * wide, (low, high))


def drive_block(flat: Flat, length: float, seed: int) -> np.ndarray:
    """Return poses of laps around the block, first along x's negative side or y's, by the seed."""
    corners = [(0.0, 0.0), (0.0, 7.5), (15.0, 7.5), (15.0, -7.5), (0.0, -7.5), (0.0, 0.0)]
    if seed % 2:
        corners = [(x, -y) for x, y in corners]
    lap = []
    for (x, y), (to_x, to_y) in zip(corners, corners[1:], strict=False):
        count = round(math.hypot(to_x - x, to_y - y) / STEP)
        share = np.arange(count) / count
        lap.append(np.stack((x + share * (to_x - x), y + share * (to_y - y)), axis=1))
    way = np.concatenate(lap * math.ceil(length / 60.0 + 0.1))
    return np.asarray(follow(np.zeros(3), way[: round(length / STEP)]))


Drive = Callable[[Flat, float, int], np.ndarray]
# By their names: what makes one of a seed, and how it is driven in.
WORLDS: dict[str, tuple[Callable[[int], Flat], Drive]] = {
    'flat': (make_flat, drive),
    'corridor': (make_corridor, drive),
    'round room': (make_round_room, drive),
    'block': (make_block, drive_block),
    'table legs': (make_office_of_legs, drive),
}
