# SPDX-License-Identifier: Apache-2.0
"""Who else may drive in a run: the navigator, a gamepad, and Foxglove's clients."""

from collections.abc import Callable, Sequence
from typing import Protocol, TYPE_CHECKING

from rclpy.node import Node

from wasd_bringup.inputs import KeySwitch
from wasd_bringup.options import RunOptions
from wasd_bringup.session_robot import SessionRobot

if TYPE_CHECKING:
    from wasd_bringup.session_foxglove import FoxgloveServer


class Guest(Protocol):
    """One of them."""

    @property
    def nodes(self) -> Sequence[Node]:
        """Its nodes, which the session spins and destroys."""

    @property
    def first_line(self) -> str:
        """What a driver must know to begin."""

    def look(self) -> None:
        """Take what has come; called often, on wall time."""

    def repeat(self) -> None:
        """Say again what is in force; called at TWIST_RATE of simulated time."""

    def halt(self) -> None:
        """Drive no more by what is held now."""

    def close(self) -> None:
        """End."""


def make_guests(
    options: RunOptions,
    robots: Sequence[SessionRobot],
    switch: KeySwitch,
    press: Callable[[str], None],
    foxglove: 'FoxgloveServer | None' = None,
) -> list[Guest]:
    """
    Return those that were asked for; `press` takes keys for the robot in turn.

    Raises:
        UserError: one cannot come.
    """
    guests: list[Guest] = []
    if options.navigates:
        from wasd_bringup.session_navigation import SessionNavigation

        navigations = [SessionNavigation(robot.options, robot) for robot in robots]
        switch.on_leave.append(lambda left: navigations[left].leave())
        guests += navigations
    # Each is loaded here, because who does not ask for it does without.
    if options.gamepad is not None:
        from wasd_bringup.session_pad import SessionPad

        stacks = [robot.stack for robot in robots]
        guests.append(SessionPad(options.gamepad, stacks, lambda: switch.active, press))
    if foxglove is not None:
        from wasd_bringup.session_foxglove import SessionFoxglove

        foxglove.now = lambda: round(robots[0].world.time * 1e9)
        nodes = [node for robot in robots for node in robot.nodes]
        nodes += [node for guest in guests for node in guest.nodes]
        guests.append(SessionFoxglove(foxglove, robots, nodes))
    return guests
