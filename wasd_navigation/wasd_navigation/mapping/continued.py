# SPDX-License-Identifier: Apache-2.0
"""Goes on with a map that was saved: finds where the robot is in it, then maps from there."""

import numpy as np

from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.mapping.session import Session
from wasd_navigation.parameters import MappingParameters
from wasd_navigation.records import Scan


class ContinuedMapper(Mapper):
    """
    A mapper that knows the places of a session.

    Until it is known where in them the robot is nothing is drawn; `reset` begins with them again.
    """

    def __init__(self, session: Session, parameters: MappingParameters | None = None) -> None:
        self._session = session
        self._finder: Localizer | None = None
        super().__init__(parameters)

    def reset(self) -> None:
        """Know the places of the session, and not where the robot is."""
        super().reset()
        self.take_session(self._session)
        self._finder = Localizer(self.grid, self._parameters)

    def start(self, pose: np.ndarray, covariance: np.ndarray) -> None:
        """Believe that the robot is near a pose in the map, shape (3,), by a covariance (3, 3)."""
        if self._finder is None:
            self._finder = Localizer(self.grid, self._parameters)
        self._finder.start(pose, covariance)

    @property
    def is_found(self) -> bool:
        """Whether it is known where the robot is."""
        return self._finder is None and super().is_found

    @property
    def notice(self) -> str:
        """A message to the driver; '' if all is well."""
        if self._finder is None:
            return super().notice
        return self._finder.notice or 'searches for its place in the map'

    @property
    def pose(self) -> np.ndarray:
        """T_map_base at the last scan, shape (3,)."""
        return super().pose if self._finder is None else self._finder.pose

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the pose in the map's axes, shape (3, 3)."""
        return super().covariance if self._finder is None else self._finder.covariance

    def step(self, scan: Scan, odometry: np.ndarray, covariance: np.ndarray) -> None:
        """Take in a scan: see `Mapper.step`."""
        finder = self._finder
        if finder is None:
            super().step(scan, odometry, covariance)
            return
        finder.step(scan, odometry, covariance)
        self.correction = finder.correction
        if finder.is_found:
            self._finder = None
            self.begin_at(finder.pose, finder.covariance, odometry, covariance)

    def take_leap(self, before: np.ndarray, after: np.ndarray) -> None:
        """Stay in place while the pose in the odom frame is another from now on, shapes (3,)."""
        if self._finder is None:
            super().take_leap(before, after)
        else:
            self._finder.take_leap(before, after)
            self.correction = self._finder.correction
