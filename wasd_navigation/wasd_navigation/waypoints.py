# SPDX-License-Identifier: Apache-2.0
"""Goals one after another: waypoints, and a patrol."""

from collections.abc import Callable, Sequence

import numpy as np

from wasd_navigation.navigator import Outcome

# A patrol that stands at one of its goals, and reached no other in a round, waits so long [s].
PATROL_REST = 10.0


class Waypoints:
    """
    Goals (x, y, yaw) that are driven to in turn, shape (3,) each; one that fails is skipped.

    `rounds` says how often all of them, None for a patrol: until in one round none was reached,
    with a rest where none was but the one at which the robot stood. `index` is of the goal that is
    driven to, `left` are those after it in this round; `missed` are the indices of those that were
    not reached, of a limited number of rounds. `tell` hears how it ends: arrived, or why not.
    """

    def __init__(
        self,
        goals: Sequence[np.ndarray],
        first: int = 0,
        rounds: int | None = 1,
        tell: Callable[[Outcome], None] = lambda outcome: None,
    ) -> None:
        self._goals, self._left, self.tell = goals, rounds, tell
        self.index, self.left = first, goals[first:]
        self.missed: list[int] = []
        self._in_vain = 0  # goals in a row that were not reached
        self._at: int | None = None  # the goal that was reached last
        self._idle = 0  # goals in a row that led nowhere else
        self._rest = 0.0  # before the next goal [s]

    def rest(self, dt: float) -> bool:
        """Let `dt` [s] pass between two goals; return whether the next one is to wait."""
        self._rest = max(0.0, self._rest - dt)
        return self._rest > 0.0

    def begin(self) -> np.ndarray:
        """Return the goal to drive to from now on."""
        self.left = self._goals[self.index + 1 :]
        return np.array(self._goals[self.index], float)

    def end(self, outcome: Outcome) -> Outcome | None:
        """Take how the goal has ended, and go on to the next; return the end of all, at it."""
        if outcome.state == 'cancelled':
            return outcome
        is_reached = outcome.state == 'arrived'
        self._in_vain = 0 if is_reached else self._in_vain + 1
        if not is_reached and self._left is not None:
            self.missed.append(self.index)
        if self._left is None and self._in_vain >= len(self._goals):
            return Outcome('failed', 'the robot reached none of its goals in a round')
        self._idle = 0 if is_reached and self.index != self._at else self._idle + 1
        self._at = self.index if is_reached else self._at
        if self._left is None and self._idle and self._idle % len(self._goals) == 0:
            self._rest = PATROL_REST
        self.index += 1
        if self.index == len(self._goals):
            if self._left == 1:
                return Outcome('arrived')
            self.index, self._left = 0, None if self._left is None else self._left - 1
        return None
