# SPDX-License-Identifier: Apache-2.0
"""A wheeled robot in the cockpit: its mode, its limits, the stick as velocities."""

import numpy as np
from wasd_cockpit.link import Marks, Setting
from wasd_core.rotations import yaw_matrix

from wasd_bringup.page.robot_view import Motion, RobotView
from wasd_bringup.robots import MODES


class WheelsView(RobotView):
    """A drive controller on two wheels."""

    def settings(self) -> tuple[Setting, ...]:
        """Return the drive's mode."""
        return (Setting('mode', MODES, self._robot.mode, 'is chosen at the start: --mode'),)

    def motion(self) -> Motion:
        """Return this instant for the plots."""
        controller = self._robot.drive_unit.controller
        target, state = controller.target, controller.odometry_state
        return Motion(
            (target.linear, 0.0, target.angular), (state.linear, state.lateral, state.angular)
        )

    def marks(self, place: np.ndarray, rotation: np.ndarray) -> Marks:
        """Return what is drawn beside the robot."""
        state = self._robot.drive_unit.controller.odometry_state
        motion = self.motion()
        return Marks(
            place=place,
            rotation=rotation,
            command=motion.command,
            measured=motion.odometry,
            estimate=np.array([state.x, state.y, 0.0]) + (*self._robot.start, place[2]),
            estimated_rotation=yaw_matrix(state.yaw),
            size=self._robot.geometry.wheel_separation,
        )
