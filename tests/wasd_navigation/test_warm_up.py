# SPDX-License-Identifier: Apache-2.0
"""Nothing is compiled on the way: a step that took seconds would leave keys unread as long."""

from collections.abc import Iterator
import sys

from lidar_room import circle
from lidar_room import look
from numba.core.registry import CPUDispatcher
import numpy as np
import pytest
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_parts
from wasd_navigation.planning.driver import Driver
from wasd_navigation.se2 import compose

SIZES = {'round': {}, 'long': {'footprint_length': 0.7, 'footprint_width': 0.31}}


def compiled_functions() -> Iterator[CPUDispatcher]:
    for name, module in list(sys.modules.items()):
        if name.startswith('wasd_navigation.'):
            for value in vars(module).values():
                if isinstance(value, CPUDispatcher):
                    yield value


@pytest.mark.parametrize('size', SIZES)
def test_what_a_step_calls_is_compiled_before(size: str) -> None:
    for function in compiled_functions():  # by other tests
        function._reset_overloads()
        function.overloads.clear()
    mapper, driver = make_parts(NavigatorParameters(**SIZES[size]), lambda words: None)
    before = {function: set(function.signatures) for function in compiled_functions()}
    assert isinstance(mapper, Mapper)
    assert isinstance(driver, Driver)
    random, slip = np.random.default_rng(0), np.array((0.5, 0.3, 0.4))
    driver.set_goal(np.array((-1.5, -1.0, 0.0)))
    for index, pose in enumerate(circle(120)[:80]):
        scan = look(pose, random)
        odometry = pose if index < 60 else compose(slip, pose)
        mapper.step(scan, odometry, index * 1e-5 * np.eye(3))
        driver.step(mapper.grid, index // 20, mapper.pose, np.zeros(3), scan, 0.05)
    assert [f for f in compiled_functions() if set(f.signatures) - before[f]] == []
