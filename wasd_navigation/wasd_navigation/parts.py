# SPDX-License-Identifier: Apache-2.0
"""What a navigator is made of by its parameters: what maps or localises, and what drives."""

from collections.abc import Callable
import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
from wasd_core.errors import Stopped, UserError
from wasd_core.jit import before_each_compilation
from wasd_core.map_picture import read_plan
from wasd_core.signals import stop_requested

from wasd_navigation.keepout import Keepout
from wasd_navigation.mapping import load_map, load_session
from wasd_navigation.mapping.continued import ContinuedMapper
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.navigator import Locator
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.goal_field import flood
from wasd_navigation.records import FREE, Grid, OCCUPIED, read_scan, Scan

Parts = tuple[Locator, Driver]
NOTICE = 'compiling, once: the navigator, which takes up to a minute of a core'
# The parts are warmed up with so many scans, on a tour so far along x [m] to both sides, in a room
# that ends so far ahead and behind, to the left and to the right [m].
WARM_UP_STEPS = 120
TOUR, ROOM, RESOLUTION = 1.0, (3.0, 2.5, 1.5), 0.05
# And then in a hall of so much [m] each way, which is too large to be looked at as a whole.
HALL = 24.0


def make_parts(settings: NavigatorParameters, say: Callable[[str], Any]) -> Parts:
    """
    Return what parameters ask for, compiled; `say` hears when that takes its time.

    Raises:
        UserError: the map cannot be read.
        Stopped: a signal came while it was compiled.
    """
    mapping = settings.mapping
    grid = load_map(Path(settings.map)) if settings.map else None
    session = None
    if settings.continue_map:
        if grid is None:
            raise UserError('continue_map: wanted a map to go on with, got none')
        session = load_session(Path(settings.map))
        if abs(session.resolution - mapping.resolution) > 1e-9:
            raise UserError(
                f'{settings.map}: cells of {session.resolution:g} m, mapping.resolution says '
                f'{mapping.resolution:g}'
            )
    with before_each_compilation(_Notice(say)):
        if grid is not None:
            _warm_up_once(Localizer(_draw_room(), mapping), settings)
        if grid is None or session is not None:
            _warm_up_once(Mapper(mapping), settings)
    locator: Locator = Mapper(mapping) if grid is None else Localizer(grid, mapping)
    if session is not None:
        locator = ContinuedMapper(session, mapping)
    return locator, make_pilot(settings)


def make_keepout(settings: NavigatorParameters) -> Keepout | None:
    """
    Return the keepout areas.

    Raises:
        UserError: they cannot be read.
    """
    if not settings.keepout:
        return None
    try:
        return Keepout(Grid(*read_plan(settings.keepout)), settings.footprint)
    except UserError as error:
        raise UserError(f'keepout: {error}') from None


def make_pilot(settings: NavigatorParameters) -> Driver:
    """Return what drives."""
    return Driver(settings.limits, settings.footprint, settings.planning)


# What this process has warmed up.
_warm: set[Any] = set()


def _warm_up_once(locator: Locator, settings: NavigatorParameters) -> None:
    """Warm up, unless that was done for the same parameters: by another robot, or a run before."""
    driven = (settings.limits, settings.footprint, settings.planning)
    key = (type(locator), settings.mapping, *driven)
    if key not in _warm:
        warm_up(locator, make_pilot(settings))
        _warm.add(key)


def warm_up(locator: Locator, pilot: Driver) -> None:
    """Run locator and pilot once in a synthetic room, so that numba compiles everything."""
    if isinstance(locator, Localizer):
        locator.start(np.array([-TOUR, 0.0, 0.0]), 1e-4 * np.eye(3))
    for step in range(WARM_UP_STEPS):
        # To and fro, so that loops are closed; in the end it finds itself in another room.
        x = TOUR * (1.0 - abs(step // 2 % 8 - 4) / 2.0)
        is_lost = step > WARM_UP_STEPS - 6
        scan = _look(x, 1.5 if is_lost else 1.0)
        locator.step(scan, np.array([x, 0.0, 0.0]), 1e-4 * (step + 1) * np.eye(3))
    grid, here = _draw_room(), np.array([-TOUR, 0.0, 0.0])
    for goal in (np.array([TOUR, 0.0, 1.0]), here + (0.3, 0.0, 0.0), here + (0.0, 0.0, 1.0)):
        pilot.set_goal(goal)
        for revision in range(6):  # as if the map had changed: ways are looked at again
            # Something comes near: it is marked, and driven around.
            scan = _look(here[0], 1.0 if revision < 3 else 0.6)
            pilot.step(grid, revision, here, np.zeros(3), scan, 0.3)
    pilot.reset()
    hall = _draw_room((0.0, 0.0), (HALL, HALL))
    pilot.set_goal(np.array([HALL - 2.0, HALL - 2.0, 0.0]))
    for _ in range(24):
        pilot.step(hall, 0, np.array([2.0, 2.0, 0.0]), np.zeros(3), None, 0.05)
    pilot.reset()
    flood(np.zeros(2, np.int64), np.ones((4, 4), np.float32), 0.5)


@functools.cache  # the tour goes to and fro
def _look(x: float, scale: float) -> Scan:
    """Return what is seen from (x, 0), looking along x, in the room, or a larger one."""
    angles = np.linspace(-math.pi, math.pi, 360)
    cos, sin = np.cos(angles), np.sin(angles)
    along = (np.where(cos > 0.0, ROOM[0], -ROOM[0]) * scale - x) / cos
    ranges = np.minimum(along, np.where(sin > 0.0, ROOM[1], -ROOM[2]) * scale / sin)
    return read_scan(ranges, angles, (0.1, 8.0))


def _draw_room(
    low: tuple[float, float] = (-ROOM[0], -ROOM[2]), high: tuple[float, float] = ROOM[:2]
) -> Grid:
    """Return the map of the room, or of another between two corners (x, y) [m]."""
    columns, rows = (round((b - a) / RESOLUTION) + 2 for a, b in zip(low, high, strict=True))
    cells = np.full((rows, columns), OCCUPIED, np.int8)
    cells[1:-1, 1:-1] = FREE
    return Grid(cells, RESOLUTION, (low[0] - RESOLUTION, low[1] - RESOLUTION))


class _Notice:
    """Tells of the first function that is compiled, not loaded; ends it when that is asked for."""

    def __init__(self, say: Callable[[str], Any]) -> None:
        self._say = say
        self._has_said = False

    def __call__(self) -> None:
        """Tell, once."""
        if stop_requested():
            raise Stopped
        if not self._has_said:
            self._has_said = True
            self._say(NOTICE)
