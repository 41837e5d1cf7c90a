# SPDX-License-Identifier: Apache-2.0
"""Goals one after another: waypoints, and a patrol."""

from collections.abc import Callable, Sequence

import numpy as np

from wasd_navigation.navigator import Outcome


class Waypoints:
    """
    Goals (x, y, yaw) that are driven to in turn, shape (3,) each; one that fails is skipped.

    `rounds` says how often all of them, None until in one round none was reached. `index` is of
    the goal that is driven to, `left` are those after it in this round; `missed` are the indices
    of those that were not reached, of a limited number of rounds. `tell` hears how it ends:
    arrived, or why not.
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
        self.index += 1
        if self.index == len(self._goals):
            if self._left == 1:
                return Outcome('arrived')
            self.index, self._left = 0, None if self._left is None else self._left - 1
        return None
