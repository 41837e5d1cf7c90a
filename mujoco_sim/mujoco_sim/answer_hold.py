# SPDX-License-Identifier: Apache-2.0
"""Physics that waits for a controller in another process."""

from collections.abc import Callable
import time

# Physics runs at most so many states ahead of a controller in another process ...
STATES_AHEAD = 3
# ... and waits so long for one that has only just begun to answer, or has gone [s of wall time].
PATIENCE = 0.2
# So many answers in a row make a controller one that is relied on.
STEADY = 10
# Looks are milliseconds apart; longer than this we were stopped ourselves [s of wall time].
LONGEST_LOOK = 0.1


class AnswerHold:
    """
    Knows which state a controller has answered last, and how long it has been waited for.

    A controller in another process that stamps its commands with the state they answer is never
    more than STATES_AHEAD states behind: on a busy machine the robot slows down instead of
    falling. One that has been answering and is still there (a process that is stopped or starved
    keeps its publisher) is waited for longer than one that has gone. After that, physics goes on
    without it, and waits again once it has answered.
    """

    def __init__(self) -> None:
        self._answered: float | None = None
        self._answers = 0
        self._held: float | None = None
        self._looked_at = 0.0

    @property
    def is_holding(self) -> bool:
        """Whether physics is being held."""
        return self._held is not None

    def answer(self, stamp: float, now: float) -> None:
        """Take a command's stamp at a simulated time [s]; one of another clock does not count."""
        self._answered = stamp if 0.0 < stamp <= now + 1e-6 else None
        self._answers = self._answers + 1 if self._answered is not None else 0
        self._held = None

    def may_advance(
        self, now: float, state_rate: float, patience: float, is_there: Callable[[], bool]
    ) -> bool:
        """
        Whether physics may go on at a simulated time [s], with so many states a second.

        `patience` [s of wall time] is for a controller that was answering and that `is_there`.
        """
        if self._answered is None or now - self._answered <= STATES_AHEAD / state_rate:
            self._held = None
            return True
        wall = time.monotonic()
        if self._held is None:
            self._held, self._looked_at = 0.0, wall
        self._held += min(wall - self._looked_at, LONGEST_LOOK)
        self._looked_at = wall
        if self._held <= PATIENCE:
            return False
        if self._answers >= STEADY and self._held <= patience and is_there():
            return False
        self._answered, self._answers, self._held = None, 0, None
        return True
