# SPDX-License-Identifier: Apache-2.0
"""Goals that cannot be are refused in the first step, with the reason, wherever they lie."""

import numpy as np
import pytest
from wasd_navigation.grid import Grid
from wasd_navigation.parameters import DriveLimits
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.footprint import Footprint

# Four metres square, free, with nothing known of the last.
CELLS = np.zeros((80, 80), np.int8)
CELLS[:, 60:] = -1


@pytest.mark.parametrize(
    ('x', 'y', 'words'), [(9.0, 0.0, 'outside the map'), (1.5, 0.0, 'nobody has looked')]
)
def test_a_goal_that_is_not_on_the_map_is_refused_with_the_reason(x, y, words):
    driver = Driver(DriveLimits(), Footprint(radius=0.2))
    driver.set_goal(np.array([x, y, 0.0]))
    grid = Grid(CELLS, 0.05, (-2.0, -2.0))
    velocity = driver.step(grid, 1, np.zeros(3), np.zeros(3), None, 0.05)
    assert velocity == pytest.approx(0.0)
    assert driver.state == 'refused'
    assert words in driver.reason
