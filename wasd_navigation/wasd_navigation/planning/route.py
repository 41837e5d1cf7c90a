# SPDX-License-Identifier: Apache-2.0
"""Whether a goal can be reached, and the way there from wherever the robot is."""

import math

import numpy as np

from wasd_navigation.planning.distance_field import Field
from wasd_navigation.planning.footprint import Footprint
from wasd_navigation.planning.goal_field import follow
from wasd_navigation.planning.goal_field import march_from
from wasd_navigation.planning.motion import clearance
from wasd_navigation.planning.parameters import PlanningParameters
from wasd_navigation.planning.sampling import value_at
from wasd_navigation.planning.surroundings import Surroundings

# A way has no more points than this.
_MOST_POINTS = 8000
# The robot is on its way up to so far from it [m], and passes no more points of it at once.
_OFF_WAY, _PASSED = 0.1, 20
# The robot's middle may be nearer to an obstacle than it should be, down to this share of its
# half width: there it is the obstacle that is wrong.
_DEEPEST = 0.5


class Route:
    """What is left from each place to one goal (x, y, yaw), and the way from one of them."""

    def __init__(
        self, goal: np.ndarray, footprint: Footprint, parameters: PlanningParameters
    ) -> None:
        self.goal = goal
        self._footprint, self._parameters = footprint, parameters
        self._room = np.empty((_MOST_POINTS, 2))
        self._beyond = 0.0
        self.values: Field | None = None
        self.way = np.empty((0, 2))

    def draw(self, around: Surroundings) -> None:
        """Work the values out for what is around now."""
        assert around.grid is not None
        parameters = self._parameters
        distances = around.distances.values[0]
        room = distances - self._footprint.inscribed - parameters.margin
        lack = np.clip(1.0 - room / parameters.comfort, 0.0, 1.0)
        price = 1.0 + parameters.comfort_price * lack * lack
        price += np.where(around.is_unknown, parameters.unknown_price, 0.0)
        price = np.where(room >= 0.0, price, np.inf).astype(np.float32)
        escape = (room < 0.0) & (distances > _DEEPEST * self._footprint.inscribed)
        row, column = map(int, around.grid.to_cells(self.goal[None, :2])[0])
        values, self._beyond = march_from((row, column), price, escape, around.grid.resolution)
        self.values = around.field_of(values[None])
        self.way = self.way[:0]

    def left(self, pose: np.ndarray) -> float:
        """Return what is left from a pose [m of free way]; infinite when no way leads there."""
        assert self.values is not None
        value: float = value_at(self.values, np.append(pose, np.zeros(3)))
        return value if value < self._beyond - 1e-3 else math.inf

    def lead_from(self, pose: np.ndarray) -> None:
        """Set `way`, shape (n, 2) [m], from a pose, or what is left of it."""
        assert self.values is not None
        if len(self.way):
            apart = np.hypot(*(self.way[:_PASSED] - pose[:2]).T)
            nearest = int(apart.argmin())
            if apart[nearest] < _OFF_WAY:
                self.way = self.way[nearest:]
                return
        count = follow(self.values, 0, pose[:2], self._room)
        self.way = np.concatenate((self._room[:count], self.goal[None, :2]))

    def is_blocked(self, around: Surroundings) -> bool:
        """Whether something is in the way that was not there when the way was drawn."""
        grid = around.grid
        assert grid is not None
        cells = grid.to_cells(self.way)
        cells = cells[grid.covers(cells)]
        near = around.distances.values[0][cells[:, 0], cells[:, 1]]
        return bool((near < self._footprint.inscribed + 0.5 * self._parameters.margin).any())


def refusal(
    goal: np.ndarray, around: Surroundings, footprint: Footprint, parameters: PlanningParameters
) -> str | None:
    """Return why a goal (x, y, yaw) is none, before any way is looked for; None: it may be one."""
    if not np.isfinite(goal).all():
        return f'the goal must be finite numbers, got ({goal[0]}, {goal[1]}, {goal[2]})'
    grid = around.grid
    if grid is None:
        return 'there is no map yet: drive around first, or give one'
    place = f'({goal[0]:.2f}, {goal[1]:.2f})'
    cell = grid.to_cells(goal[None, :2])
    if not grid.covers(cell)[0]:
        low = grid.origin
        high = grid.to_points(np.array(grid.cells.shape)[None])[0]
        return (
            f'{place} is outside the map, which goes from ({low[0]:.1f}, {low[1]:.1f}) to '
            f'({high[0]:.1f}, {high[1]:.1f})'
        )
    state = np.append(goal, np.zeros(3))
    needed = parameters.margin
    room = clearance(around.distances, footprint.circles, state, needed)
    if room < needed:
        what = 'is in an obstacle' if room < -footprint.inscribed else 'is too near an obstacle'
        return f'{place} {what}: the robot needs {needed:.2f} m around it, there are {room:.2f} m'
    if around.is_unknown[tuple(cell[0])]:
        return f'nobody has looked at {place} yet: choose a place that the map shows as free'
    return None
