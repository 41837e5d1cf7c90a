# SPDX-License-Identifier: Apache-2.0
"""What the cockpit has to know of a robot, whatever it walks or rolls on."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from teleop_keyboard.keymap import direction_words, factor_words, Keymap
from wasd_cockpit.link import Choice, KeyCap, Marks, Setting, Stick, StickUse

Numbers = Sequence[float] | np.ndarray


class Motion(NamedTuple):
    """Velocities [m/s], [m/s], [rad/s] of one instant, forces on feet [N], which are to stand."""

    command: Numbers
    odometry: Numbers
    forces: Numbers = ()
    stances: Numbers = ()


class Described(ABC):
    """A robot's controller as the cockpit shows it; what it changes, it changes by keys."""

    feet: tuple[str, ...] = ()

    @abstractmethod
    def choices(self) -> tuple[Choice, ...]:
        """Return the states as buttons."""

    @abstractmethod
    def settings(self) -> tuple[Setting, ...]:
        """Return what is chosen."""

    @abstractmethod
    def keys_to_choose(self, setting: str, option: str) -> tuple[str, ...]:
        """Return the keys that choose an option of a setting; none where none do."""

    @abstractmethod
    def keys(self) -> tuple[KeyCap, ...]:
        """Return the keymap."""

    @abstractmethod
    def stick_use(self) -> StickUse:
        """Return what the stick does now."""

    def stick_keys(self, stick: Stick) -> tuple[str, ...] | None:
        """Return the keys that bring a stick of keys there; None where velocities drive."""
        return None

    @abstractmethod
    def motion(self) -> Motion:
        """Return this instant for the plots."""

    @abstractmethod
    def marks(self, place: np.ndarray, rotation: np.ndarray) -> Marks:
        """Return what is drawn beside a robot that is there [m], in the world's axes."""


def keymap_caps(keymap: Keymap) -> tuple[KeyCap, ...]:
    """Return the keys of a keymap and what each does."""
    return (
        *(KeyCap(key, direction_words(way), True) for key, way in keymap.motion.items()),
        *(KeyCap(key, 'stop at once') for key in sorted(keymap.stop_keys)),
        *(KeyCap(key, factor_words(way)) for key, way in keymap.speed_keys.items()),
    )
