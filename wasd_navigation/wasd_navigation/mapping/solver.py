# SPDX-License-Identifier: Apache-2.0
"""Has the pose graph's equations solved in portions, while the robot goes on."""

from collections.abc import Callable, Iterator

import numpy as np

from wasd_navigation.mapping.pose_graph import Edges
from wasd_navigation.mapping.pose_graph import factorise
from wasd_navigation.mapping.pose_graph import find_pattern
from wasd_navigation.mapping.pose_graph import linearise
from wasd_navigation.mapping.pose_graph import solve

# Products of blocks of one portion: half a millisecond.
PORTION = 4000
# Steps shorter than this are none [m], [rad]; more of them are not taken.
SMALLEST, MOST_STEPS = 5e-4, 6


class Solver:
    """Works on the poses that it was given first, until they have settled and are taken."""

    def __init__(self) -> None:
        self._is_asked = False
        self._running: Iterator[np.ndarray | None] | None = None
        self._solved: np.ndarray | None = None

    def ask(self) -> None:
        """Want the poses solved for, now or after what is being solved."""
        self._is_asked = True

    def take(self) -> np.ndarray | None:
        """Return the poses if they have settled, of the nodes that there were then."""
        solved, self._solved = self._solved, None
        return solved

    def work(self, poses: np.ndarray, edges: Callable[[], Edges]) -> bool:
        """Do one portion, and return whether there was one to do."""
        if self._running is None:
            if not self._is_asked or self._solved is not None:
                return False
            self._is_asked = False
            self._running = _solve(poses.copy(), edges())
        self._solved = next(self._running)
        if self._solved is not None:
            self._running = None
        return True


def _solve(poses: np.ndarray, edges: Edges) -> Iterator[np.ndarray | None]:
    pattern = find_pattern(len(poses), edges.pairs)
    for _ in range(MOST_STEPS):
        yield None
        system = linearise(poses, edges, pattern)
        turn = 0
        while turn < len(pattern.order):
            turn = factorise(system, pattern, turn, PORTION)
            if turn < len(pattern.order):
                yield None
        steps = solve(system, pattern)
        poses = poses + steps
        poses[:, 2] = (poses[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        if np.abs(steps).max() < SMALLEST:
            break
    yield poses
