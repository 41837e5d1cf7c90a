# SPDX-License-Identifier: Apache-2.0
"""The interface of a run to other processes; this one has no others."""

import time
from typing import TYPE_CHECKING

from mujoco_sim.simulation import Schedule

from wasd_bringup.run.robot import Robot

if TYPE_CHECKING:
    from wasd_bringup.run.navigation import NavigationDriver


class Face:
    """
    The face of a run towards other processes, which it can do without.

    It is made when the robots are there, and may configure them; `show_navigation` and `begin`
    follow. The run calls `begin_instant` first in each instant, `look_who_drives` at TWIST_RATE,
    `handle` and `save` on wall time; the `schedule_` methods come after the robot's own.
    """

    def show_navigation(self, navigation: 'NavigationDriver') -> None:
        """Show a robot's navigator; it may be configured."""

    def begin(self) -> None:
        """Let others drive, too: all robots and navigators are there, nothing is scheduled."""

    def begin_instant(self) -> None:
        """Take the simulated time of an instant."""

    def look_who_drives(self) -> None:
        """Tell who drives each robot, where that has changed."""

    def schedule_control(self, robot: Robot, schedule: Schedule) -> None:
        """Tell on a schedule what a robot's controller knows."""

    def schedule_sensing(self, robot: Robot, schedule: Schedule) -> None:
        """Tell on a schedule what the simulator knows of a robot."""

    def each_second(self) -> None:
        """Tell how the controllers do; called once a second of wall time."""

    def handle(self, timeout: float) -> None:
        """Take what others ask for, waiting for it up to `timeout` [s]."""
        if timeout > 0.0:
            time.sleep(timeout)

    def save(self) -> None:
        """Bring what is written of the run up to date; called often, on wall time."""

    def flush(self) -> None:
        """Give what was told last the time to leave the process."""

    def close(self) -> None:
        """End it, after the robots."""
