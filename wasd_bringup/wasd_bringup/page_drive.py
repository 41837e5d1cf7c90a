# SPDX-License-Identifier: Apache-2.0
"""What a viewer's keys have set moving, so that it does not outlive the viewer."""

from collections.abc import Sequence
from typing import Protocol

from teleop_keyboard.key_names import HELD
from teleop_keyboard.key_names import RELEASE
from teleop_keyboard.key_names import split_event


class Drive(Protocol):
    """What is to be known of the keys of one robot."""

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion that keys have set going."""

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""


class PageDrive:
    """
    Remembers, for each robot, whether a viewer's keys still move it.

    A key that is down does until it is let go, one that latches until somebody presses a stop key.
    A robot that only others drive is none of a viewer's: its loss must not stop it.
    """

    def __init__(self, drives: Sequence[Drive]) -> None:
        self._drives = drives
        self._down: list[set[str]] = [set() for _ in drives]
        self._latched = [False for _ in drives]

    @property
    def moved(self) -> list[int]:
        """The robots that a viewer's keys move."""
        pairs = enumerate(zip(self._down, self._latched, strict=True))
        return [robot for robot, (down, is_latched) in pairs if down or is_latched]

    def press(self, robot: int, key: str, from_view: bool) -> None:
        """Take a key message for a robot."""
        event, base = split_event(key)
        drive = self._drives[robot]
        if not event and drive.stops(base):
            self._latched[robot] = False
        if not from_view:
            return
        if event == RELEASE:
            self._down[robot].discard(base)
        elif event == HELD:
            self._down[robot].add(base)
        elif drive.latches(base):
            self._latched[robot] = True

    def reset(self) -> None:
        """Note that all robots stand."""
        for robot in range(len(self._drives)):
            self.forget(robot)

    def forget(self, robot: int) -> None:
        """Note that a robot was stopped."""
        self._down[robot].clear()
        self._latched[robot] = False
