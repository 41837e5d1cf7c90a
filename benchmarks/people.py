# SPDX-License-Identifier: Apache-2.0
"""
People in the way of a robot that drives to goals, without physics.

The robot knows what its lidar sees, the ideal one (1 cm of noise), and its odometry, which errs as
its wheels' does; it drives by the map that it made of the flat, and by its own pose. People are
boxes of 44 x 24 cm. Those who walk about stop for a robot that stands before them, and turn to
somewhere else; those who do not yield walk on through whatever is there.
"""

from collections.abc import Callable
import dataclasses
import math
from typing import Any

from cores import all_on_cores
from explore import NEAR, PATIENCE, Ride, TURNED
from kinematic import RATE
import numpy as np
from table import format_count, Row
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import ways_from
from wasd_navigation.records import OCCUPIED

FIRST_SEED = 7800  # some of the hundred before were looked at
HALF = (0.12, 0.22)  # of a person, along the walk and across [m]
WALKING, CROSSING, HEAD_ON = 0.8, 0.6, 1.0  # [m/s]
PEOPLE, GOALS = 3, 5
# They keep so far from walls, and stop so far before a robot [m]; then turn after so long [s].
ROOM, BEFORE, WAITS = 0.35, 0.8, 2.0
# Goals where somebody comes are no nearer, so that there is a way to meet on [m].
FAR = 5.0
# Who crosses begins at least, and at most, so far beside the way; and walks on for at least so
# far beyond it, at most as far [m].
BESIDE, BEYOND = (1.0, 2.5), 0.4
# Who comes head-on is so far ahead on the way at first [m].
AHEAD = 4.5
# A robot that is slower stands [m/s], [rad/s]: somebody who walks into it then is to blame.
STANDS = (0.03, 0.1)
MOST = 0.95


def person(place: np.ndarray, heading: float) -> np.ndarray:
    """Return a person as a box, shape (6,)."""
    return np.array((place[0], place[1], *HALF, 1.7, heading))


def lengths(line: np.ndarray) -> np.ndarray:
    """Return how far along a line each of its places (n, 2) is, shape (n,) [m]."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))


class Stroller:
    """Walks from place to place, and stops for a robot that is before him."""

    def __init__(self, ride: Ride, random: np.random.Generator) -> None:
        self._ride, self._random = ride, random
        grid = ride.course.grid
        self._distances = measure_distances(grid.cells == OCCUPIED, grid.resolution)
        self._distances[grid.cells != 0] = -1.0
        self._free = grid.to_points(np.argwhere(self._distances > ROOM))
        robot = ride.moving.pose[:2]
        far = self._free[np.hypot(*(self._free - robot).T) > 2.0]
        self.place = far[random.integers(len(far))].copy()
        self.heading, self._waited = 0.0, 0.0
        self._choose()

    def _choose(self) -> None:
        """Choose where to go."""
        grid = self._ride.course.grid
        goal = self._free[self._random.integers(len(self._free))]
        price = np.where(self._distances > ROOM, 1.0, np.inf).astype(np.float32)
        self._left = ways_from(grid.to_cells(goal[None])[0], price, grid.resolution)

    def step(self, dt: float) -> np.ndarray:
        """Walk for a time [s]; return the box."""
        grid = self._ride.course.grid
        row, column = map(int, grid.to_cells(self.place[None])[0])
        near = self._left[row - 2 : row + 3, column - 2 : column + 3]
        least = np.unravel_index(int(near.argmin()), near.shape)
        is_there = self._left[row, column] < 0.2 or near.min() == math.inf
        if is_there:
            self._choose()
            return person(self.place, self.heading)
        ahead = grid.to_points(np.array([[row - 2 + least[0], column - 2 + least[1]]]))[0]
        along = ahead - self.place
        self.heading = math.atan2(along[1], along[0])
        if self._is_blocked():
            self._waited += dt
            if self._waited > WAITS:
                self._waited = 0.0
                self._choose()
            return person(self.place, self.heading)
        self._waited = 0.0
        self.place = self.place + WALKING * dt * along / max(float(np.hypot(*along)), 1e-9)
        return person(self.place, self.heading)

    def _is_blocked(self) -> bool:
        """Whether the robot is before him."""
        to = self._ride.moving.pose[:2] - self.place
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        ahead, aside = cos * to[0] + sin * to[1], -sin * to[0] + cos * to[1]
        return bool(-0.2 < ahead < BEFORE and abs(aside) < 0.55)


class Walker:
    """Walks along a line of places, shape (n, 2), at a speed, and does not yield."""

    def __init__(self, line: np.ndarray, speed: float) -> None:
        self._line, self._speed = line, speed
        self._gone = lengths(line)
        self._at = 0.0

    def come(self) -> list[np.ndarray]:
        """Walk for a period; return the box, none at the end of the line."""
        self._at += self._speed * (1.0 / RATE)
        if self._at > self._gone[-1]:
            return []
        place = [np.interp(self._at, self._gone, values) for values in self._line.T]
        index = min(int(np.searchsorted(self._gone, self._at)), len(self._line) - 1)
        along = self._line[index] - self._line[max(index - 1, 0)]
        return [person(np.array(place), math.atan2(along[1], along[0]))]


class Meeting:
    """
    Rides to a goal while people move.

    `touches` counts the steps in which it moved and touched somebody; `met` is whether anybody
    came; `least` and `walls` are the least distances from people and from all else [m].
    """

    def __init__(self, ride: Ride) -> None:
        self.ride, self._flat = ride, ride.flat
        self.touches, self.met = 0, False
        self.least = self.walls = math.inf

    def go(self, goal: np.ndarray, come: Callable[[], list[np.ndarray]]) -> dict[str, Any]:
        """Drive to a goal; `come` returns the people of each step."""
        ride, unit = self.ride, self.ride.unit
        begin, until = ride.moving.time, ride.moving.time + PATIENCE
        unit.go(goal)
        while unit.navigator.goal is not None and ride.moving.time < until:
            people = come()
            boxes = self._flat.boxes
            if people:
                boxes = np.concatenate((boxes, np.array(people)))
            ride.flat = dataclasses.replace(self._flat, boxes=boxes)
            ride.step()
            self._look(people)
        ride.flat = self._flat
        off = ride.moving.pose - goal
        return {
            'goal': goal.tolist(),
            'outcome': str(unit.navigator.outcome),
            'off': math.hypot(off[0], off[1]),
            'turned_off': abs(math.remainder(off[2], 2.0 * math.pi)),
            'touches': self.touches,
            'gap': self.least,
            'walls': self.walls,
            'took': ride.moving.time - begin,
        }

    def _look(self, people: list[np.ndarray]) -> None:
        """See whether somebody or something is touched."""
        moving = self.ride.moving
        gap = moving.gap(np.array(people)) if people else math.inf
        self.least = min(self.least, gap)
        self.walls = min(self.walls, moving.gap(self._flat.boxes))
        stands = np.hypot(*moving.velocity[:2]) < STANDS[0] and abs(moving.velocity[2]) < STANDS[1]
        self.touches += bool(gap <= 0.0 and not stands)

    def crossing(self, random: np.random.Generator) -> Callable[[], list[np.ndarray]]:
        """Return who crosses the way so that they would meet."""
        walker: Walker | None = None
        across: tuple[np.ndarray, np.ndarray] | None = None

        def come() -> list[np.ndarray]:
            nonlocal walker, across
            if walker is None:
                across = across or self._line_across(random)
                if across is None:
                    return []
                line, cross = across
                left = float(np.hypot(*(line[0] - cross)))
                ahead = float(np.hypot(*(self.ride.moving.pose[:2] - cross)))
                if ahead / self.ride.course.robot.limits.forward > left / CROSSING:
                    return [person(line[0], 0.0)]
                walker, self.met = Walker(line, CROSSING), True
            return walker.come()

        return come

    def _line_across(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray] | None:
        """Return a line across the way, and where it crosses; None where there is no room."""
        path = self.ride.unit.navigator.pilot.path
        if self.ride.unit.navigator.state != 'driving' or len(path) < 10:
            return None
        gone = lengths(path)
        distances = self._room()
        for index in random.permutation(np.flatnonzero((gone > 2.0) & (gone < 4.0))):
            x, y = path[min(index + 3, len(path) - 1)] - path[max(index - 3, 0)]
            across = np.array((-y, x)) / max(math.hypot(x, y), 1e-9) * random.choice((-1.0, 1.0))
            spans = []
            for side in (across, -across):
                steps = np.arange(0.0, BESIDE[1], 0.05)[:, None]
                cells = self.ride.course.grid.to_cells(path[index] + steps * side)
                inside = self.ride.course.grid.covers(cells)
                free = np.zeros(len(steps), bool)
                free[inside] = distances[tuple(cells[inside].T)] > 0.3
                spans.append(0.05 * (len(free) if free.all() else int(free.argmin())))
            begin = path[index] + across * (spans[0] - 0.05)
            end = path[index] - across * (spans[1] - 0.05)
            off = math.dist(begin, self.ride.moving.pose[:2])
            if spans[0] >= BESIDE[0] and spans[1] >= BEYOND and off > 1.5:
                return np.stack((begin, end)), path[index]
        return None

    def _room(self) -> np.ndarray:
        grid = self.ride.course.grid
        return measure_distances(grid.cells != 0, grid.resolution)

    def head_on(self) -> Callable[[], list[np.ndarray]]:
        """Return who comes along the way of the robot."""
        walker: Walker | None = None
        behind: list[np.ndarray] = []

        def come() -> list[np.ndarray]:
            nonlocal walker
            navigator = self.ride.unit.navigator
            behind.append(self.ride.moving.pose[:2].copy())
            if walker is None:
                path = navigator.pilot.path
                if navigator.state != 'driving' or len(path) < 10 or len(behind) < 40:
                    return []
                gone = lengths(path)
                if gone[-1] < AHEAD:
                    return []
                begin = int(np.searchsorted(gone, AHEAD))
                back = np.array(behind[::-1][::4])
                walker, self.met = Walker(np.concatenate((path[begin::-1], back)), HEAD_ON), True
            return walker.come()

        return come


def known(name: str, seed: int) -> Ride:
    """Return a robot in a flat that it has explored."""
    ride = Ride(name, seed)
    ride.explore()
    return ride


def among_people(ride: Ride, seed: int) -> list[dict[str, Any]]:
    """Drive to goals while three people walk about."""
    random = np.random.default_rng((seed, 91))
    strollers = [Stroller(ride, random) for _ in range(PEOPLE)]
    drives = []
    for _ in range(GOALS):
        goal = ride.course.choose_goal()
        meeting = Meeting(ride)
        drive = meeting.go(goal, lambda: [one.step(1.0 / RATE) for one in strollers])
        drives.append({'seed': seed, **drive})
    return drives


def meet(ride: Ride, seed: int, kind: str) -> dict[str, Any]:
    """Drive to goals while somebody comes who does not yield, until he is met, six at most."""
    random, touches = np.random.default_rng((seed, 92, len(kind))), 0
    for _ in range(6):
        meeting = Meeting(ride)
        come = meeting.crossing(random) if kind == 'crossing' else meeting.head_on()
        drive = meeting.go(ride.course.choose_goal(FAR), come)
        touches += drive['touches']
        if meeting.met:
            break
    return {**drive, 'seed': seed, 'kind': kind, 'met': meeting.met, 'touches': touches}


def is_there(drive: dict[str, Any]) -> bool:
    """Whether a goal was reached without a touch of anything, by the truth."""
    near = drive['off'] <= NEAR and drive['turned_off'] <= TURNED
    is_clear = drive['touches'] == 0 and drive['walls'] > 0.0
    return 'arrived' in drive['outcome'] and near and is_clear


def _drive(seed: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the drives among people in a flat, and those that meet somebody."""
    ride = known('mbot', seed)
    crowd = among_people(ride, seed)
    return crowd, [meet(ride, seed, kind) for kind in ('crossing', 'head-on')]


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure mbot among people."""
    note('people: mbot')
    done = all_on_cores(_drive, range(FIRST_SEED, FIRST_SEED + (1 if quick else 20)))
    crowd = [drive for drives, _ in done for drive in drives]
    meetings = [meeting for _, met in done for meeting in met]
    there = sum(map(is_there, crowd))
    touched = sum(drive['touches'] > 0 for drive in crowd)
    rows = [
        Row(
            what='goals, mbot: 3 people walk about, own map and pose, ideal lidar, no physics',
            measured=f'{format_count(there, len(crowd))} there without a touch; {touched} touched '
            'somebody',
            must=f'>= {100.0 * MOST:g} %, 0 touched',
            passed=there >= MOST * len(crowd) and touched == 0,
            trials=crowd,
        )
    ]
    for kind, speed in (('crossing', CROSSING), ('head-on', HEAD_ON)):
        tried = [one for one in meetings if one['kind'] == kind]
        met = [one for one in tried if one['met']]
        touched = sum(one['touches'] > 0 for one in tried)
        there = sum(map(is_there, met))
        rows.append(
            Row(
                what=f'goals, mbot: somebody comes {kind} at {speed:g} m/s and does not yield',
                measured=f'{touched} of {len(met)} touched by a robot that moved; '
                f'{there} goals reached',
                must='0 touched',
                passed=touched == 0 and bool(met),
                trials=tried,
            )
        )
    return rows
