# SPDX-License-Identifier: Apache-2.0
"""Who else may drive in a run: the navigator, a gamepad, and Foxglove's clients."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import functools
from typing import Protocol, TYPE_CHECKING

from rclpy.node import Node
from teleop_keyboard.gamepad import JoyTwist
from teleop_keyboard.gamepad_node import GamepadNode, PadOutput
from teleop_keyboard.parameters import PAD_HELP, PadParameters

from wasd_bringup.inputs import KeySwitch
from wasd_bringup.options import RunOptions
from wasd_bringup.session_robot import SessionRobot

if TYPE_CHECKING:
    from wasd_bringup.session_foxglove import FoxgloveServer
    from wasd_bringup.session_navigation import SessionNavigation


class SessionPad:
    """
    Velocities of a pad go to one of several robots, its keys to `press`.

    `look` is called on wall time, `repeat` on simulated time: while a stick drives, the robot is
    told at TWIST_RATE, however fast its time goes. `active` says which robot is driven; when that
    is another one, the first is stopped and what is held counts after it was let go.
    """

    def __init__(
        self,
        device: str,
        robots: Sequence[SessionRobot],
        active: Callable[[], int],
        press: Callable[[str], None],
    ) -> None:
        """
        Look for the pad.

        Raises:
            UserError: the device can never be one.
        """
        self._robots = robots
        self._active = active
        self._driven = active()
        self._velocity = JoyTwist()
        self.node = GamepadNode(
            output=PadOutput(self._drive, press, self._say),
            pad=PadParameters(device=device, preset=robots[self._driven].stack.pad_preset),
        )
        self.nodes: list[Node] = [self.node]
        self.disarm = self.node.halt
        self.close = self.node.close
        self.look()

    @property
    def first_line(self) -> str:
        """What a driver must know to begin."""
        gamepad = self.node.gamepad
        awaits = '' if gamepad.is_there else f' ({gamepad.problem or "none is there yet"})'
        return f'gamepad{awaits}: {PAD_HELP[self._robots[self._driven].stack.pad_preset]}'

    def look(self) -> None:
        """Take what the pad has said."""
        active = self._active()
        if active != self._driven:
            self.node.take_preset(self._robots[active].stack.pad_preset)
            self._driven = active
        self.node.look()

    def repeat(self) -> None:
        """Tell the robot again, while a stick drives it."""
        if self.node.is_enabled:
            self._drive(self._velocity)

    def _drive(self, velocity: JoyTwist) -> None:
        # One zero is enough: others may drive while this pad does not.
        if velocity == self._velocity == JoyTwist():
            return
        self._velocity = velocity
        self._robots[self._driven].drive((velocity.vx, velocity.vy, velocity.wz), 'gamepad')

    def _say(self, words: str) -> None:
        self._robots[self._driven].stack.say(words)


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

    def disarm(self) -> None:
        """Let nothing that is held now count."""

    def close(self) -> None:
        """End."""


@dataclass
class Told:
    """
    Whom a session tells of keys, of looks at its viewer, to let go of what is held, of its end.

    A look comes with the wall time, and with the time between two frames of the viewer [s].
    """

    of_keys: list[Callable[[str], None]] = field(default_factory=list)
    of_looks: list[Callable[[float, float], None]] = field(default_factory=list)
    to_let_go: list[Callable[[], None]] = field(default_factory=list)
    of_the_end: list[Callable[[], None]] = field(default_factory=list)


def make_navigations(
    options: RunOptions, robots: Sequence[SessionRobot], switch: KeySwitch
) -> 'list[SessionNavigation]':
    """
    Return a navigator of each robot, where a map was asked for.

    Raises:
        UserError: one has no lidar, or the map cannot be read.
    """
    if not options.navigates:
        return []
    # Here, because who does not ask for it does without.
    from wasd_bringup.session_navigation import SessionNavigation

    navigations = [SessionNavigation(robot.options, robot) for robot in robots]
    switch.on_leave.append(lambda left: navigations[left].leave())
    return navigations


def make_guests(
    options: RunOptions,
    robots: Sequence[SessionRobot],
    switch: KeySwitch,
    press: Callable[..., None],
    foxglove: 'FoxgloveServer | None',
    navigations: Sequence[Guest],
) -> list[Guest]:
    """
    Return the others that were asked for; `press` takes keys for the robot in turn.

    Raises:
        UserError: one cannot come.
    """
    guests = list(navigations)
    if options.gamepad is not None:
        press_by_pad = functools.partial(press, by='gamepad')
        guests.append(SessionPad(options.gamepad, robots, lambda: switch.active, press_by_pad))
    if foxglove is not None:
        # Here, because who does not ask for it does without.
        from wasd_bringup.session_foxglove import SessionFoxglove

        foxglove.now = lambda: round(robots[0].world.time * 1e9)
        nodes = [node for robot in robots for node in robot.nodes]
        nodes += [node for guest in guests for node in guest.nodes]
        guests.append(SessionFoxglove(foxglove, robots, nodes))
    return guests
