# SPDX-License-Identifier: Apache-2.0
"""A wheeled robot in the cockpit: its mode, its limits, the stick as velocities."""

import numpy as np
from wasd_cockpit.link import Choice, KeyCap, Marks, Setting, StickUse
from wasd_core.rotations import yaw_matrix

from wasd_bringup.cockpit.described import Described, keymap_caps, Motion
from wasd_bringup.mbot_stack import MbotStack
from wasd_bringup.robots import MODES


class Wheels(Described):
    """A drive controller on two wheels."""

    def __init__(self, stack: MbotStack) -> None:
        self._stack = stack

    def choices(self) -> tuple[Choice, ...]:
        """Return no states: wheels know none."""
        return ()

    def settings(self) -> tuple[Setting, ...]:
        """Return the drive's mode."""
        return (Setting('mode', MODES, self._stack.mode, 'is chosen at the start: --mode'),)

    def keys_to_choose(self, setting: str, option: str) -> tuple[str, ...]:
        """Return no keys: nothing can be chosen."""
        return ()

    def keys(self) -> tuple[KeyCap, ...]:
        """Return the keymap."""
        return keymap_caps(self._stack.logic.keymap)

    def stick_use(self) -> StickUse:
        """Return what the stick does now."""
        logic = self._stack.logic
        return StickUse((logic.speed, 0.0, logic.turn), 'drives', sideways=False)

    def motion(self) -> Motion:
        """Return this instant for the plots."""
        controller = self._stack.driver.controller
        target, state = controller.target, controller.odometry_state
        return Motion(
            (target.linear, 0.0, target.angular), (state.linear, state.lateral, state.angular)
        )

    def marks(self, place: np.ndarray, rotation: np.ndarray) -> Marks:
        """Return what is drawn beside the robot."""
        state = self._stack.driver.controller.odometry_state
        command, measured = (tuple(map(float, part)) for part in self.motion()[:2])
        return Marks(
            place=place,
            rotation=rotation,
            command=(command[0], command[1], command[2]),
            measured=(measured[0], measured[1], measured[2]),
            estimate=np.array([state.x, state.y, 0.0]) + (*self._stack.start, place[2]),
            estimated_rotation=yaw_matrix(state.yaw),
            size=self._stack.geometry.wheel_separation,
        )
