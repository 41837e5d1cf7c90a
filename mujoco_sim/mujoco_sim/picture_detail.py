# SPDX-License-Identifier: Apache-2.0
"""How much is drawn on the page: shadows and the like only where they do not slow it down."""

import mujoco

# A browser that draws so many plain pictures a second, for so long [s], gets detailed ones.
FAST, FAST_FOR = 20, 3.0
# One that then draws fewer than this a second, for so long [s], gets plain ones again.
SLOW, SLOW_FOR = 10, 3.0

# Not post-processing: without it colours are wrong, and too dark.
_COSTLY = (int(mujoco.mjtRndFlag.mjRND_SHADOW), int(mujoco.mjtRndFlag.mjRND_REFLECTION))


class PictureDetail:
    """
    Decides whether a browser is asked for shadows and reflections.

    It begins without: on a machine without a graphics card they cost seconds a picture. A browser
    that draws fast earns them, once: one that they make slow does without from then on.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin with another browser."""
        self.is_full = False
        self._may_rise = True
        self._since = 0.0

    def step(self, rate: int | None, dt: float) -> None:
        """Let `dt` [s] pass in which so many pictures a second were drawn; None if not known."""
        if rate is None:
            is_wrong = False
        elif self.is_full:
            is_wrong = rate < SLOW
        else:
            is_wrong = self._may_rise and rate >= FAST
        self._since = self._since + dt if is_wrong else 0.0
        if self.is_full and self._since >= SLOW_FOR:
            self.is_full, self._may_rise, self._since = False, False, 0.0
        elif not self.is_full and self._since >= FAST_FOR:
            self.is_full, self._since = True, 0.0

    def flags(self, flags: list[int]) -> list[int]:
        """Return a renderer's flags with the costly ones as decided."""
        return [
            int(self.is_full) if flag in _COSTLY else value for flag, value in enumerate(flags)
        ]
