# SPDX-License-Identifier: Apache-2.0
"""Physics that waits for a controller in another process."""

import time

# Physics runs at most so many states ahead of a controller in another process ...
STATES_AHEAD = 3
# ... that has answered within this time [s of wall time].
PATIENCE = 0.2


class AnswerHold:
    """
    Knows which state a controller has answered last, and how long it has been waited for.

    A controller in another process that stamps its commands with the state they answer is never
    more than STATES_AHEAD states behind: on a busy machine the robot slows down instead of
    falling. One that does not answer for PATIENCE of wall time is waited for no longer.
    """

    def __init__(self) -> None:
        self._answered: float | None = None
        self._held_since: float | None = None

    def answer(self, stamp: float, now: float) -> None:
        """Take a command's stamp at a simulated time [s]; one of another clock does not count."""
        self._answered = stamp if 0.0 < stamp <= now + 1e-6 else None
        self._held_since = None

    def may_advance(self, now: float, state_rate: float) -> bool:
        """Whether physics may go on at a simulated time [s], with so many states a second."""
        if self._answered is None or now - self._answered <= STATES_AHEAD / state_rate:
            self._held_since = None
            return True
        wall = time.monotonic()
        if self._held_since is None:
            self._held_since = wall
        return wall - self._held_since > PATIENCE
