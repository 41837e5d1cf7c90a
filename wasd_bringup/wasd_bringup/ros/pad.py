# SPDX-License-Identifier: Apache-2.0
"""`--gamepad`: a pad drives the selected robot."""

from collections.abc import Callable, Sequence

from teleop_keyboard.gamepad import JoyTwist
from teleop_keyboard.gamepad_node import GamepadNode, PadOutput
from teleop_keyboard.parameters import PAD_HELP, PadParameters

from wasd_bringup.run.robot import Robot


class PadDriver:
    """
    Velocities of a pad go to one of several robots, its keys to `press`.

    `look` is called on wall time, `repeat` on simulated time: while a stick drives, the robot is
    told at TWIST_RATE, however fast its time goes. `active` says which robot is driven; when that
    is another one, the first is stopped and what is held counts after it was let go.
    """

    def __init__(
        self,
        device: str,
        robots: Sequence[Robot],
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
            pad=PadParameters(device=device, preset=robots[self._driven].kind.pad_preset),
        )
        self.disarm = self.node.disarm
        self.close = self.node.close
        self.look()

    @property
    def first_line(self) -> str:
        """The first line for the user."""
        gamepad = self.node.gamepad
        awaits = '' if gamepad.is_there else f' ({gamepad.problem or "none is there yet"})'
        return f'gamepad{awaits}: {PAD_HELP[self._robots[self._driven].kind.pad_preset]}'

    def look(self) -> None:
        """Take what the pad has said."""
        active = self._active()
        if active != self._driven:
            self.node.take_preset(self._robots[active].kind.pad_preset)
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
        self._robots[self._driven].say(words)
