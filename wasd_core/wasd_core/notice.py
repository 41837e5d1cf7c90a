# SPDX-License-Identifier: Apache-2.0
"""What a driver is told: a text that goes by itself after a while."""

from wasd_core.watchdog import Watchdog

# How long a text stands [s].
READING_TIME = 3.0


class Notice:
    """
    The last thing said to a driver, until it is old.

    It reads no clock: `step` is told what has passed [s]. A text begins with what is to be done;
    what explains it stands in parentheses at the end, and is left out first (`brief`).
    """

    def __init__(self, seconds: float = READING_TIME) -> None:
        self._text = ''
        self._fresh = Watchdog(seconds)

    @property
    def text(self) -> str:
        """What is to be read now; '' when there is nothing, or nothing any more."""
        return self._text if self._fresh.is_alive else ''

    def say(self, text: str | None) -> bool:
        """Show a text from now on, or none; return whether it is one that was not being shown."""
        is_new = bool(text) and text != self.text
        self._text = text or ''
        self._fresh.hear()
        return is_new

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._fresh.step(dt)


def brief(text: str) -> str:
    """Return a text without the explanation in parentheses at its end."""
    return text[: text.rindex(' (')] if text.endswith(')') and ' (' in text else text
