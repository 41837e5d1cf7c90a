# SPDX-License-Identifier: Apache-2.0
"""Places that a mapping robot has been to: where, what it saw there, what is known of pairs."""

from dataclasses import dataclass
from dataclasses import field

import numpy as np

from wasd_navigation.mapping.local_map import add_surface
from wasd_navigation.mapping.local_map import LocalMap
from wasd_navigation.mapping.pose_graph import Edges
from wasd_navigation.scan import Scan


@dataclass
class Places:
    """Nodes of the pose graph with their scans, and its edges."""

    scans: list[Scan] = field(default_factory=list)
    surfaces: list[np.ndarray] = field(default_factory=list)
    _poses: np.ndarray = field(default_factory=lambda: np.zeros((64, 3)))
    _pairs: list[tuple[int, int]] = field(default_factory=list)
    _edges: list[tuple[np.ndarray, np.ndarray, bool]] = field(default_factory=list)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.scans)

    @property
    def poses(self) -> np.ndarray:
        """Where they are in the map, shape (n, 3); may be written."""
        poses: np.ndarray = self._poses[: len(self)]
        return poses

    def add(self, scan: Scan, surface: np.ndarray, pose: np.ndarray) -> None:
        """Add a place."""
        if len(self) == len(self._poses):
            self._poses = np.concatenate((self._poses, np.zeros_like(self._poses)))
        self._poses[len(self)] = pose
        self.scans.append(scan)
        self.surfaces.append(surface)

    def link(self, pair: tuple[int, int], pose: np.ndarray, known: np.ndarray, sure: bool) -> None:
        """Add that the second has a pose in the first's frame, with an information (3, 3)."""
        self._pairs.append(pair)
        self._edges.append((pose, known, not sure))

    def edges(self) -> Edges:
        """Return all that is known of pairs."""
        poses, known, robust = zip(*self._edges, strict=True)
        return Edges(np.array(self._pairs), np.array(poses), np.array(known), np.array(robust))

    def show(self, local: LocalMap, middle: np.ndarray, numbers: np.ndarray) -> None:
        """Have a local map hold what was seen from some of them, around a place [m]."""
        local.clear(middle)
        for number in numbers:
            add_surface(local, self._poses[number], self.surfaces[number])
