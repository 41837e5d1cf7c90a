# SPDX-License-Identifier: Apache-2.0
"""The cockpit's view of a robot with legs or wheels."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from teleop_keyboard.keymap import direction_words, factor_words, Keymap
from wasd_cockpit.link import Choice, Elevation, KeyCap, Marks, Setting, Stick, StickUse

from wasd_bringup.run.robot import Robot

Numbers = Sequence[float] | np.ndarray


class Motion(NamedTuple):
    """Velocities [m/s], [m/s], [rad/s] of one instant, forces on feet [N], which are to stand."""

    command: Numbers
    odometry: Numbers
    forces: Numbers = ()
    stances: Numbers = ()


class RobotView:
    """A robot's controller as the cockpit shows it; what it changes, it changes by keys."""

    feet: tuple[str, ...] = ()
    no_elevation = 'this robot maps no elevation'  # why, '' where it does

    def __init__(self, robot: Robot) -> None:
        self._robot: Any = robot
        # Whether the page looks at the robot's elevation now.
        self.is_looked_at: Callable[[], bool] = lambda: False

    def choices(self) -> tuple[Choice, ...]:
        """Return the states as buttons."""
        named = self._robot.named
        return tuple(each._replace(key=named(each.key)) for each in self._robot.choices())

    def settings(self) -> tuple[Setting, ...]:
        """Return what is chosen."""
        return ()

    def keys_to_choose(self, setting: str, option: str) -> tuple[str, ...]:
        """Return the keys that choose an option of a setting; none where none do."""
        return ()

    def keys(self) -> tuple[KeyCap, ...]:
        """Return the keymap, after the keys of states that it leaves free."""
        caps: list[KeyCap] = []
        if (logic := self._robot.logic) is not None:
            keymap: Keymap = logic.keymap
            caps += [KeyCap(key, direction_words(way)) for key, way in keymap.motion.items()]
            caps += [KeyCap(key, 'stop at once') for key in sorted(keymap.stop_keys)]
            caps += [KeyCap(key, factor_words(way)) for key, way in keymap.speed_keys.items()]
        taken = {cap.key for cap in caps}
        states = [KeyCap(choice.key, choice.name) for choice in self.choices()]
        return (*(cap for cap in states if cap.key not in taken), *caps)

    def stick_use(self) -> StickUse:
        """Return what the stick does now."""
        logic = self._robot.logic
        full = (0.0, 0.0, 0.0) if logic is None else (logic.speed, 0.0, logic.turn)
        return StickUse(full, 'drives', sideways=False)

    def stick_keys(self, stick: Stick) -> tuple[str, ...] | None:
        """Return the keys that bring a stick of keys there; None where velocities drive."""
        return None

    def motion(self) -> Motion:
        """Return this instant for the plots."""
        sample, odometry = self._robot.sample(), self._robot.odometry
        if odometry is None:
            return Motion(sample.command, (0.0, 0.0, 0.0))
        vx, vy, _ = odometry.linear_velocity.tolist()
        return Motion(sample.command, (vx, vy, float(odometry.angular_velocity[2])))

    def marks(self, place: np.ndarray, rotation: np.ndarray) -> Marks:
        """Return what is drawn beside a robot that is there [m], in the world's axes."""
        return Marks(place=place, rotation=rotation)

    def elevation(self) -> Elevation | None:
        """Return the heights that it has mapped around it; None before there are any."""
        return None
