# SPDX-License-Identifier: Apache-2.0
"""Buttons of a gamepad as keys: by their names, alone or with others held."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wasd_core.errors import suggest
from wasd_core.parameters import InvalidParameter

from teleop_keyboard.gamepad import JoyState

# Name -> its button and its axis, -1 where there is none. A trigger is an axis, a button or both.
Controls = Mapping[str, tuple[int, int]]
# As xpad numbers them, and hid-playstation all but the last four.
USUAL_CONTROLS: Controls = {
    'A': (0, -1),
    'B': (1, -1),
    'X': (2, -1),
    'Y': (3, -1),
    'L1': (4, -1),
    'R1': (5, -1),
    'L2': (-1, 2),
    'R2': (-1, 5),
    'SELECT': (6, -1),
    'START': (7, -1),
    'MODE': (8, -1),
}
# BTN_ and ABS_ codes of linux/input-event-codes.h.
BUTTON_CODES = {
    'A': 0x130,
    'B': 0x131,
    'X': 0x133,
    'Y': 0x134,
    'L1': 0x136,
    'R1': 0x137,
    'L2': 0x138,
    'R2': 0x139,
    'SELECT': 0x13A,
    'START': 0x13B,
    'MODE': 0x13C,
}
AXIS_CODES = {'L2': 0x02, 'R2': 0x05}
# An axis that goes from 1 at rest to -1 is down from here on.
PULLED = -0.5


def controls_of(axis_codes: Sequence[int], button_codes: Sequence[int]) -> Controls:
    """Return where each name is on a pad that says what its axes and buttons are."""

    def place(codes: Sequence[int], code: int | None) -> int:
        return codes.index(code) if code in codes else -1

    return {
        name: (place(button_codes, code), place(axis_codes, AXIS_CODES.get(name)))
        for name, code in BUTTON_CODES.items()
    }


class Binding(NamedTuple):
    """`key` is pressed by `button` while all of `held` are down."""

    held: frozenset[str]
    button: str
    key: str


def parse_binding(text: str) -> Binding:
    """
    Return what `L2+A=2` says: A presses the key 2 while L2 is down.

    Raises:
        InvalidParameter: it is not so written, or names a button that pads have not.
    """
    buttons, separator, key = text.partition('=')
    *held, last = buttons.split('+')
    if not separator or not key:
        raise InvalidParameter(f"keys: got {text!r}, wanted 'BUTTON=KEY' or 'BUTTON+BUTTON=KEY'")
    for name in (*held, last):
        if name not in BUTTON_CODES:
            raise InvalidParameter(f'keys: {text}: no button {name}{suggest(name, BUTTON_CODES)}')
    return Binding(frozenset(held), last, key)


class PadKeys:
    """
    The keys that the buttons of a pad press.

    `step` takes its state and returns the keys pressed since the last one; the first state after
    `reset` presses none. Of several bindings of a button that with most others held counts.
    """

    def __init__(self, bindings: Sequence[str], controls: Controls = USUAL_CONTROLS) -> None:
        self._bindings = [parse_binding(text) for text in bindings]
        self.controls = controls
        self.reset()

    def reset(self) -> None:
        """Know nothing of the buttons."""
        self._down: frozenset[str] | None = None

    def step(self, state: JoyState) -> list[str]:
        """Return the keys that are pressed with this state."""
        down = frozenset(n for n, (b, a) in self.controls.items() if _is_down(state, b, a))
        fresh = down - (down if self._down is None else self._down)
        self._down = down
        keys = []
        for button in sorted(fresh):
            fitting = [b for b in self._bindings if b.button == button and b.held <= down]
            if fitting:
                keys.append(max(fitting, key=lambda binding: len(binding.held)).key)
        return keys


def _is_down(state: JoyState, button: int, axis: int) -> bool:
    is_pressed = 0 <= button < len(state.buttons) and bool(state.buttons[button])
    return is_pressed or (0 <= axis < len(state.axes) and state.axes[axis] <= PULLED)
