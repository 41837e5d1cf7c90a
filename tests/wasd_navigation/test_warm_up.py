# SPDX-License-Identifier: Apache-2.0
"""Nothing is compiled on the way: a step that took seconds would leave keys unread as long."""

from collections.abc import Callable, Iterator
from pathlib import Path
import sys

from lidar_room import circle, look, RAYS
from numba.core.registry import CPUDispatcher
import numpy as np
import pytest
from wasd_navigation.mapping import save_map
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.navigator import Locator
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_parts
from wasd_navigation.planning.driver import Driver
from wasd_navigation.records import Grid
from wasd_navigation.se2 import compose

from wasd_navigation import parts

# Each compiles, or reads what was compiled.
pytestmark = pytest.mark.slow

SIZES = {'round': {}, 'long': {'footprint_length': 0.7, 'footprint_width': 0.31}}


def compiled_functions() -> Iterator[CPUDispatcher]:
    for name, module in list(sys.modules.items()):
        if name.startswith('wasd_navigation.'):
            for value in vars(module).values():
                if isinstance(value, CPUDispatcher):
                    yield value


def make_anew(settings: NavigatorParameters) -> tuple[Locator, Driver, Callable[[], list[str]]]:
    """Return the parts, and a function that tells what has been compiled since."""
    for function in compiled_functions():  # by other tests
        function._reset_overloads()
        function.overloads.clear()
    parts._warm.clear()
    locator, pilot = make_parts(settings, lambda words: None)
    before = {function: set(function.signatures) for function in compiled_functions()}

    def compiled_since() -> list[str]:
        return [f.__name__ for f in compiled_functions() if set(f.signatures) - before[f]]

    return locator, pilot, compiled_since


def test_what_is_warm_is_not_warmed_up_again(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(parts, '_warm', set())
    monkeypatch.setattr(parts, 'warm_up', lambda locator, pilot: said.append(str(locator)))
    for name in ('round', 'round', 'long', 'round'):
        make_parts(NavigatorParameters(**SIZES[name]), lambda words: None)
    assert len(said) == len(SIZES)


@pytest.mark.parametrize('size', SIZES)
def test_what_a_step_calls_is_compiled_before(size: str) -> None:
    mapper, driver, compiled_since = make_anew(NavigatorParameters(**SIZES[size]))
    assert isinstance(mapper, Mapper)
    assert isinstance(driver, Driver)
    random, slip = np.random.default_rng(0), np.array((0.5, 0.3, 0.4))
    driver.set_goal(np.array((-1.5, -1.0, 0.0)))
    for index, pose in enumerate(circle(120)[:80]):
        scan = look(pose, random)
        odometry = pose if index < 60 else compose(slip, pose)
        mapper.step(scan, odometry, index * 1e-5 * np.eye(3))
        driver.step(mapper.grid, index // 20, mapper.pose, np.zeros(3), scan, 0.05)
    assert compiled_since() == []


def test_what_a_robot_with_a_map_calls_is_compiled_before(tmp_path: Path) -> None:
    mapper, random = Mapper(), np.random.default_rng(1)
    for pose in circle(60):
        mapper.step(look(pose, random), pose, np.zeros((3, 3)))
    text, _ = save_map(mapper.grid, tmp_path / 'room')
    localizer, driver, compiled_since = make_anew(NavigatorParameters(map=str(text)))
    assert isinstance(localizer, Localizer)
    hand, found = np.array((-0.8, -0.6, 2.0)), []
    for index, pose in enumerate(circle(240)[:120]):
        at = pose if index < 60 else compose(hand, pose)
        localizer.step(look(at, random), pose, index * 1e-5 * np.eye(3))
        found.append(localizer.is_found)
    assert found[59]
    assert not all(found[60:])
    assert found[-1]
    assert compiled_since() == []
    assert is_blocked_on_its_way(driver, localizer.grid)
    assert compiled_since() == []


def is_blocked_on_its_way(driver: Driver, grid: Grid) -> bool:
    """Whether another way is drawn when something stands on that to a goal."""
    start, random = np.array((-1.5, -1.0, 0.0)), np.random.default_rng(2)
    driver.set_goal(np.array((2.0, -1.0, 0.0)))
    ways = []
    for index in range(60):
        scan = look(start, random)
        if index >= 20:
            near = scan.ends[np.abs(RAYS) < 0.3]
            scan.ends[np.abs(RAYS) < 0.3] = near / np.hypot(*near.T)[:, None]
        driver.step(grid, 0, start, np.zeros(3), scan, 0.05)
        ways.append(driver.distance_left)
    return ways[-1] > ways[19] + 0.05
