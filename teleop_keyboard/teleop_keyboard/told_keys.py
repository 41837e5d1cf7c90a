# SPDX-License-Identifier: Apache-2.0
"""The keys that a terminal tells to be down, for as long as it goes on telling."""

from wasd_core.timing import RELEASE, STOP_KEY, with_event

from teleop_keyboard.hold import (
    DELAY_FACTOR,
    DELAY_MARGIN,
    FIRST_REPEAT_TIMEOUT,
    LONGEST_FIRST_TIMEOUT,
)

# A key that repeats is down for so long after its last repeat [s]: a terminal that says nothing
# has hung, as ssh does, or its machine sleeps.
REPEAT_TIMEOUT = 0.3
# More keys than anybody can hold down; noise must not make us note more.
MOST_DOWN = 64


class ToldKeys:
    """
    Keys that are down by the word of a terminal that tells presses, repeats and releases.

    A release that is not told may be one that cannot be told any more. So a key lives on repeats,
    and as only the key that was pressed last repeats, on those of any key. A press counts for
    FIRST_REPEAT_TIMEOUT, or longer where the last two keys took longer to repeat; a repeat and a
    release for REPEAT_TIMEOUT. It reads no clock: `step` lets time pass.
    """

    def __init__(self) -> None:
        self._down: dict[str, str] = {}  # name of each by its place
        self._left = 0.0  # how long they count without another word [s]
        self._last = ''  # the place of the key that is to repeat
        self._since_press: float | None = None  # of that key, until it repeats [s]
        self._delays = 0.0, 0.0  # of the last two keys that repeated [s]

    @property
    def names(self) -> tuple[str, ...]:
        """The keys that are down."""
        return tuple(self._down.values())

    def press(self, place: str, name: str, is_repeat: bool) -> list[str]:
        """
        Note a press or a repeat; a press of a key that is down is a repeat, too.

        Return the release of its old name where Shift, pressed meanwhile, has given it a new one.
        """
        if is_repeat or place in self._down:
            if place == self._last and self._since_press is not None:
                self._delays = self._delays[1], self._since_press
                self._since_press = None
            self._left = REPEAT_TIMEOUT
        else:
            self._since_press = 0.0
            # One late delivery does not make a slow keyboard.
            delay, self._left = min(self._delays), FIRST_REPEAT_TIMEOUT
            if delay > FIRST_REPEAT_TIMEOUT:
                self._left = min(DELAY_FACTOR * delay + DELAY_MARGIN, LONGEST_FIRST_TIMEOUT)
        self._last = place
        before = self._down.pop(place, name)
        self._down[place] = name
        if len(self._down) > MOST_DOWN:
            del self._down[next(iter(self._down))]
        return [] if before == name else [with_event(RELEASE, before)]

    def release(self, place: str) -> list[str]:
        """Return the event of a release, under the name of the press; none for an unknown one."""
        name = self._down.pop(place, None)
        # The teller is there, and a key that was just pressed has yet to repeat.
        self._left = max(self._left, REPEAT_TIMEOUT)
        return [] if name is None else [with_event(RELEASE, name)]

    def forget(self) -> list[str]:
        """Return the events of a release of all."""
        names = [with_event(RELEASE, name) for name in self.names]
        self._down.clear()
        return names

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._left -= dt
        if self._since_press is not None:
            self._since_press += dt

    def give_up(self) -> list[str]:
        """
        Return the events that end keys of which nothing was told for too long.

        Where the key that ought to repeat is among them, the terminal is lost: STOP, without a
        ramp. An older key alone does not repeat; it is as if it were released.
        """
        if not self._down or self._left > 0.0:
            return []
        is_lost = self._last in self._down
        return [*self.forget(), *([STOP_KEY] if is_lost else [])]
