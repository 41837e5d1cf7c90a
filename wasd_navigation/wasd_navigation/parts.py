# SPDX-License-Identifier: Apache-2.0
"""What a navigator is made of by its parameters: what maps or localises, and what drives."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

from numba.core import event
import numpy as np
from wasd_core.errors import Stopped
from wasd_core.signals import stop_requested

from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.map_file import load_map
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.navigator import Locator
from wasd_navigation.navigator import Pilot
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.planning.driver import Driver
from wasd_navigation.scan import read_scan

Parts = tuple[Locator, Pilot]
NOTICE = 'compiling, once: the navigator, which takes some 20 s of a core'
# Ways and turns of the robot that the parts are warmed up with: a new place with each.
WARM_UP_STEPS = 6


def make_parts(settings: NavigatorParameters, say: Callable[[str], Any]) -> Parts:
    """
    Return what parameters ask for, compiled; `say` hears when that takes its time.

    Raises:
        UserError: the map cannot be read.
        Stopped: a signal came while it was compiled.
    """
    grid = load_map(Path(settings.map)) if settings.map else None

    def make_locator() -> Locator:
        return Mapper(settings.mapping) if grid is None else Localizer(grid, settings.mapping)

    with event.install_listener('numba:compile', _Notice(say)):
        warm_up(make_locator(), make_pilot(settings))
    return make_locator(), make_pilot(settings)


def make_pilot(settings: NavigatorParameters) -> Driver:
    """Return what drives."""
    return Driver(settings.limits, settings.footprint, settings.planning)


def warm_up(locator: Locator, pilot: Pilot) -> None:
    """Have both do a little of all they can, in a square room: what they compile is there then."""
    angles = np.linspace(-math.pi, math.pi, 360)
    ranges = 3.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    scan = read_scan(ranges, angles, (0.1, 5.0), np.zeros(3))
    for step in range(WARM_UP_STEPS):
        locator.step(scan, np.array([0.4 * (step % 2), 0.0, 0.0]), 1e-6 * (step + 1) * np.eye(3))
    for goal in (np.array([1.5, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        pilot.set_goal(goal)
        for revision in range(3):  # as if the map had changed: ways are looked at again
            pilot.step(locator.grid, revision, np.zeros(3), np.zeros(3), scan, 0.3)


class _Notice(event.Listener):
    """Tells of the first function that is compiled, not loaded; ends it when that is asked for."""

    def __init__(self, say: Callable[[str], Any]) -> None:
        self._say = say
        self._has_said = False

    def on_start(self, event: Any) -> None:
        """Tell, once."""
        if stop_requested():
            raise Stopped
        if not self._has_said:
            self._has_said = True
            self._say(NOTICE)

    def on_end(self, event: Any) -> None:
        """Nothing to do."""
