# SPDX-License-Identifier: Apache-2.0
"""`--guard`: no source drives a robot of a run into what its lidar sees."""

from collections.abc import Sequence

import numpy as np
from wasd_navigation.guard import Guard, GuardSenses, warm_up
from wasd_navigation.parameters import footprint_of

from wasd_bringup.run.robot import Robot
from wasd_bringup.run.sensing import guard_parameters_of, lidar_of, listen_to_lidar, size_of

# A command that stays the same is looked at again after so long [s].
PERIOD = 0.02
# Its last action is out of date after this [s].
FRESH = 0.2


class RobotGuard:
    """
    Limits what the controller is asked for, in simulated time, whichever source asks.

    Raises:
        UserError: the robot has no lidar, or its controller cannot be held back.
    """

    def __init__(self, robot: Robot) -> None:
        # First: who has no controller to limit is not told to add a lidar.
        robot.hold_back(self._limit)
        tag = lidar_of(robot, '--guard')
        size = {'robot_radius': 0.0, 'footprint_length': 0.0, 'footprint_width': 0.0}
        footprint = footprint_of(*(size | size_of(robot)).values())
        warm_up(footprint)
        self._robot = robot
        self.unit = Guard(footprint, np.array(robot.braking), guard_parameters_of(robot))
        self._senses = GuardSenses(self.unit)
        self._asked: tuple[float, ...] | None = None
        self._stepped_at = self._passed_at = robot.world.time
        robot.guard_words = lambda: self.words
        robot.drivers.guard = lambda: self.action
        robot.simulation.on_reset.append(self._reset)
        listen_to_lidar(robot, tag, self._senses, self._catch_up)

    @property
    def words(self) -> str:
        """What it does to the command in force, and why; '' where it does nothing."""
        action = self.action
        return f'guard, {action}: {self.unit.last.why}' if action else ''

    @property
    def action(self) -> str:
        """What it does to the command in force, in a word; '' for nothing."""
        is_fresh = self._robot.world.time - self._stepped_at < FRESH
        return self.unit.last.action if is_fresh else ''

    def _limit(self, asked: Sequence[float]) -> np.ndarray:
        """Return how much of a velocity (vx, vy, wz) to follow now."""
        now, wanted = self._robot.world.time, tuple(asked)
        dt = now - self._stepped_at
        if wanted != self._asked or dt >= PERIOD - 1e-9:
            self._asked, self._stepped_at = wanted, now
            self._catch_up()
            # The controller's parameters may have changed.
            self.unit.brake_by(self._robot.braking, self._robot.braking_delay)
            self.unit.step(np.array(wanted))
        return self.unit.last.velocity

    def _catch_up(self) -> None:
        """Let time pass up to now, and take the odometry of now."""
        base, now = self._robot.odometry, self._robot.world.time
        self.unit.pass_time(now - self._passed_at)
        self._passed_at = now
        if base is not None:
            self._senses.take_odometry(now, base, self._robot.frames)

    def _reset(self) -> None:
        self._senses.reset()
        self._asked = None
