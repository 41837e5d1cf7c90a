# SPDX-License-Identifier: Apache-2.0
"""What a navigator knows of the ground: the elevation of a quadruped that walks by sight."""

import numpy as np
from quadruped_sim.elevation import Elevation
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.traversability import Traversability

from wasd_bringup.run.go2 import Go2

# The highest step that a Go2 climbs by sight [m], one after another; see docs/legs_math.md.
CLIMB = 0.17
# Heights are judged five times a second: once in so many clouds.
CLOUDS_EACH = 3


class Ground:
    """Judges the elevation while the robot walks by sight."""

    def __init__(self, robot: Go2, unit: RobotNavigator) -> None:
        self._robot, self._unit = robot, unit
        self._model = robot.legs.model
        self.judged = Traversability(CLIMB * self._model.scale.of('m'))
        robot.elevation.on_map.append(self._take)
        robot.simulation.on_reset.append(self.judged.reset)
        unit.on_reset.append(self.judged.reset)

    def step(self) -> None:
        """Let it count while the eyes are open."""
        self._unit.use_ground(self.judged if self._robot.legs.controller.eyes else None)

    def _take(self, elevation: Elevation, now: float) -> None:
        controller, navigator = self._robot.legs.controller, self._unit.navigator
        state = controller.robot
        is_due = self._robot.elevation.clouds % CLOUDS_EACH == 0 and controller.eyes
        if state is None or not navigator.scans or not is_due:
            return
        cell = elevation.resolution
        heights = np.empty((elevation.count, elevation.count))
        first = elevation.write_window(heights, state.base.position)
        floor = state.base.position[2] - state.height(self._model.geometry.foot_radius)
        locator = navigator.locator
        resolution = locator.grid.resolution
        self.judged.take(heights, first * cell, cell, float(floor), locator.correction, resolution)
