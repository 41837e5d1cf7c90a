# SPDX-License-Identifier: Apache-2.0
"""Whether a goal can be reached, and the path there from the robot."""

import math
from typing import Any

import numpy as np

from wasd_navigation.parameters import Footprint, PlanningParameters
from wasd_navigation.planning.distances import Field, look_up_each
from wasd_navigation.planning.goal_field import DiscField, flood, reaches, shortest
from wasd_navigation.planning.heading_field import EASY, HeadingField, SHORT
from wasd_navigation.planning.motion import Base, clearance, HARD, IN_GAP, least_clearance
from wasd_navigation.planning.overview import Overview, Rooms
from wasd_navigation.planning.sampling import value_at
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import FEWEST

# The robot is on its way up to so far from it [m], and passes no more points of it at once.
_OFF_WAY, _PASSED = 0.15, 20
# So much of a field is drawn in one step: 3 ms, or 6 on a slow host; more, by this share, before
# the robot drives and while its way is blocked.
SLICE, AT_ONCE = 9000, 2.0
# A way longer than the shortest by this factor is drawn once more, to be short rather than easy;
# of ways longer than this that is not asked [m]. A short one keeps clear by so much, or by as much
# as the easy one [m], and is shorter by this factor.
_LONG, _FAR, _CLEAR, _SHORTER = 1.1, 15.0, 0.1, 0.98
# Values are worked out again when something changed, but no more often than this [s], and than the
# latter when the way is blocked.
_REDRAW, _REDRAW_BLOCKED = 1.0, 0.25
# What is no wider than this may go away, as a person or a chair does: the robot drives so near to
# a goal there, to look [m].
_MAY_GO, _LOOK = 1.0, 1.2


# What is left to a goal from everywhere, on its way to be drawn.
Drawing = DiscField | HeadingField


class Route:
    """
    The remaining cost from each place to one goal (x, y, yaw), and the path from one place.

    `draw` begins to work it out for what is around now, each `work` goes on with it; until that is
    good enough the last drawing holds, and `keep_up` sees to it that it is not too old. `settle`
    looks whether the way is a long one; `is_settled` says that it need not look. `way`, shape
    (n, 3), are places and headings. `goal` is the pose nearest to the one that was `asked` for
    where there is room: see `aim`. With `may_be_unknown` the map grows: the goal may be in unknown
    space, or where something stands that may go away.
    """

    def __init__(
        self,
        goal: np.ndarray,
        footprint: Footprint,
        base: Base,
        parameters: PlanningParameters,
        may_be_unknown: bool = False,
    ) -> None:
        self.asked = self.goal = goal
        self.may_be_unknown = may_be_unknown
        self._footprint, self._base, self._parameters = footprint, base, parameters
        self._now: Drawing | None = None
        self._next: Drawing | None = None
        self._drawn, self._since_drawn = -1, 0.0  # revision of what is around, and its age [s]
        self._is_urgent = False
        self._rooms = Rooms()
        self._overview: Overview | None = None  # of `_next`
        self._beyond: Overview | None = None  # of `_now`
        self._is_cut_off = False  # within what is looked at of a large map
        self._kept = HARD  # of the margin, everywhere on the way
        self._taste = EASY
        self._around: Surroundings | None = None  # what was drawn last
        self._easy: Drawing | None = None  # while there may be one that is short
        self.is_settled = footprint.is_circle  # the way is not made shorter
        self.way = np.empty((0, 3))

    @property
    def off(self) -> float:
        """How far the goal is from where it was asked to be [m]."""
        return math.dist(self.goal[:2], self.asked[:2])

    @property
    def is_to_look(self) -> bool:
        """Whether the goal is too far from the one asked for, but lets the robot look there."""
        return self.off > self._parameters.tolerance + 1e-6

    def refusal(self, around: Surroundings) -> str | None:
        """Return why the pose asked for is no goal, without a search; None: it may be one."""
        goal = self.asked
        if not np.isfinite(goal).all():
            return f'the goal must be finite numbers, got ({goal[0]}, {goal[1]}, {goal[2]})'
        grid = around.whole
        if min(grid.cells.shape) < FEWEST:
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
        if not around.grid.has(goal[:2]):
            around = around.at(goal)
            cell = around.grid.to_cells(goal[None, :2])
        elif around.is_windowed:
            cell = around.grid.to_cells(goal[None, :2])
        state = np.append(goal, np.zeros(3))
        needed = HARD * self._parameters.margin
        room = clearance(around.distances_of_goals, self._footprint.circles, state, needed)
        if room < needed:
            what = (
                'is in an obstacle'
                if room < -self._footprint.inscribed
                else 'is too near an obstacle'
            )
            has = (
                f'there are {room:.2f} m' if room >= 0.0 else f'and would overlap by {-room:.2f} m'
            )
            return f'{place} {what}: the robot needs {needed:.2f} m around it, {has}'
        if around.is_unknown[tuple(cell[0])] and not self.may_be_unknown:
            return f'{place} is unknown: choose a free place of the map'
        return None

    def aim(self, around: Surroundings, pose: np.ndarray) -> None:
        """
        Aim at the pose with room that is nearest to the one asked for, as seen from a pose.

        Where the map grows it may be farther than the tolerance: see `is_to_look`.
        """
        may_be_unknown = self.may_be_unknown
        found = self._nearest_free(around, pose, self._parameters.tolerance, may_be_unknown)
        if found is None and may_be_unknown and self._may_go(around):
            found = self._nearest_free(around, pose, _LOOK, False)
        if found is not None:
            self.goal = found
        elif self.may_be_unknown:
            self.goal = self.asked  # what is seen now shows no place that would do

    def _nearest_free(
        self, around: Surroundings, pose: np.ndarray, tolerance: float, may_be_unknown: bool
    ) -> np.ndarray | None:
        """
        Return the pose with room that is nearest to the one asked for, if there is one.

        It is no farther than a tolerance [m], where the map is known unless it `may_be_unknown`,
        and on this side of all walls: a disc as wide as the robot gets there from a pose.
        """
        goal = self.asked
        if around.is_windowed and not around.grid.has(goal[:2]):
            around = around.at(goal)
        field, grid = around.distances_of_goals, around.grid
        needed = HARD * self._parameters.margin
        count = int(tolerance / grid.resolution)
        steps = np.arange(-count, count + 1) * grid.resolution
        offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        away = np.hypot(offsets[:, 0], offsets[:, 1])
        near = np.argsort(away, kind='stable')
        places = goal[:2] + offsets[near[away[near] <= tolerance + 1e-9]]
        # A goal in an obstacle does not mean the unknown space behind it.
        may_be_unknown &= (
            look_up_each(field, 0, goal[None, :2])[0] > 0.5 * self._footprint.inscribed
        )
        inside = grid.covers(grid.to_cells(places))
        places, cells = places[inside], grid.to_cells(places[inside])
        is_known = ~around.is_unknown[tuple(cells.T)] | may_be_unknown
        # Leave out the many places that are far too near to an obstacle.
        is_known &= (
            field.values[0][tuple(cells.T)] > self._footprint.inscribed - 1.5 * grid.resolution
        )
        is_reached: np.ndarray | None = None
        for place, cell in zip(places[is_known], cells[is_known], strict=True):
            state = np.array((*place, goal[2], 0.0, 0.0, 0.0))
            if clearance(field, self._footprint.circles, state, needed) < needed:
                continue
            if is_reached is None:
                if (place == goal[:2]).all():
                    return goal
                if not grid.has(pose[:2]):
                    return state[:3]  # far away: its way will show
                room = around.distances.values[0]
                here = grid.to_cells(pose[None, :2])[0]
                is_reached = flood(here, room, self._footprint.inscribed)
            if is_reached[tuple(cell)]:
                return state[:3]
        return None

    def _may_go(self, around: Surroundings) -> bool:
        """Whether all obstacles at the goal are small enough to be something that may go away."""
        goal = self.asked
        if around.is_windowed and not around.grid.has(goal[:2]):
            around = around.at(goal)
        grid, distances = around.grid, around.distances.values[0]
        x, y, radius = self._footprint.circles[0]
        reach = math.hypot(x, y) + radius + grid.resolution
        low, high = grid.to_cells(np.stack((goal[:2] - reach, goal[:2] + reach)))
        corner = np.maximum(low, 0)
        near = distances[corner[0] : high[0] + 1, corner[1] : high[1] + 1]
        for cell in np.argwhere(near < 0.0) + corner:
            # Cells that touch at a corner belong to one thing.
            thing = np.argwhere(flood(cell, -distances, -0.55 * grid.resolution))
            if (np.ptp(thing, axis=0) - 1).max() * grid.resolution > _MAY_GO:
                return False
        return True

    def draw(self, around: Surroundings) -> None:
        """Begin to work the values out for what is around now."""
        self._drawn, self._since_drawn = around.revision, 0.0
        self._next, self._around = None, around
        if self._needs_overview(around):
            reach = self._footprint.inscribed + self._kept * self._parameters.margin
            self._overview = Overview(self.goal, around, self._rooms, reach)
        else:
            self._overview = None
            self._draw_near(around)

    def _needs_overview(self, around: Surroundings) -> bool:
        return around.is_windowed and (self._is_cut_off or not around.grid.has(self.goal[:2]))

    def _draw_near(self, around: Surroundings) -> None:
        """Begin to draw what is looked at."""
        footprint, parameters = self._footprint, self._parameters
        border = None if self._overview is None else border_of(around, self._overview)
        if footprint.is_circle:
            reach = footprint.inscribed + self._kept * parameters.margin
            self._next = DiscField(self.goal, around, reach, border)
        else:
            self._next = HeadingField(
                self.goal,
                around,
                footprint.circles,
                self._base,
                (self._kept * parameters.margin, parameters.margin),
                self._taste,
                border,
            )

    def work(self, pose: np.ndarray, budget: int = SLICE) -> None:
        """Go on with it, for a robot at a pose."""
        if self._overview is not None and not self._overview.is_done:
            if self._overview.work() and self._around is not None:
                self._draw_near(self._around)
        elif self._next is not None:
            if self._next.work(pose, budget):
                self._now, self._next, self._beyond = self._next, None, self._overview
                self.way = self.way[:0]
                self._look_beyond(pose)
        elif self._now is not None and not self._now.is_done:
            self._now.work(pose, budget)

    def _look_beyond(self, pose: np.ndarray) -> None:
        """
        Where no way leads, draw once more: one may lead around, or through a narrow gap.

        A robot that stands in such a gap leaves it as it came in.
        """
        around = self._around
        if around is None:
            return
        is_open = self.left(pose) < math.inf
        if not is_open and around.is_windowed and self._overview is None:
            self._is_cut_off = True
        elif self._kept > IN_GAP and not (is_open and self._has_room(around, pose)):
            self._kept = IN_GAP
        else:
            return
        self.draw(around)

    def _has_room(self, around: Surroundings, pose: np.ndarray) -> bool:
        """Whether a long robot at a pose is as far from the map's obstacles as its way keeps."""
        circles, needed = self._footprint.circles, self._kept * self._parameters.margin
        if self._footprint.is_circle:
            return True
        return bool(clearance(around.distances_of_map, circles, pose, needed) >= needed)

    def _way_from(self, drawing: Drawing, pose: np.ndarray) -> np.ndarray:
        """Return a way from a pose by a drawing; beyond what is looked at, by the overview."""
        way = drawing.way_from(pose)
        overview, around = self._beyond, self._around
        if overview is None or around is None or around.grid.has(self.goal[:2]) or len(way) < 2:
            return way
        places = overview.way_from(way[-2, :2])
        far = np.column_stack((places, np.full(len(places), way[-2, 2])))
        return np.concatenate((way[:-1], far, way[-1:]))

    def no_way(self, around: Surroundings, pose: np.ndarray) -> str:
        """Return in words that no way leads to the goal, and how wide the widest one is [m]."""
        goal = self.goal
        needed = self._footprint.inscribed + IN_GAP * self._parameters.margin
        begins = f'no way leads to ({goal[0]:.2f}, {goal[1]:.2f})'
        grid, distances = around.grid, around.distances.values[0]
        if not grid.has(goal[:2]) or not grid.has(pose[:2]):
            return begins
        ends = grid.to_cells(np.stack((goal[:2], pose[:2])))
        low, high = 0.0, 2.0 * needed
        if not flood(ends[1], distances, low)[tuple(ends[0])]:
            return f'{begins}: it is shut off'
        while high - low > 0.005:
            middle = 0.5 * (low + high)
            is_wide = flood(ends[1], distances, middle)[tuple(ends[0])]
            low, high = (middle, high) if is_wide else (low, middle)
        if low >= needed:
            return f'{begins}: the robot, which is long, cannot turn where it would have to'
        # Rounded away from each other: what is too narrow looks so.
        wide, wanted = math.floor(200.0 * low) / 100.0, math.ceil(200.0 * needed - 1e-6) / 100.0
        return (
            f'{begins}: in the map the widest is about {wide:.2f} m wide, {wanted:.2f} are needed'
        )

    def is_shut_off(self, around: Surroundings, pose: np.ndarray) -> bool:
        """Whether not even the middle of a long robot could come to the goal, however it turns."""
        if self._footprint.is_circle or around.is_windowed:
            return False  # its route is drawn to find that out
        field, grid = around.distances, around.grid
        row, column = map(int, grid.to_cells(self.goal[None, :2])[0])
        rows, columns = grid.cells.shape
        low = int(min(max((pose[1] - field.y) / field.resolution, 0), rows - 2))
        left = int(min(max((pose[0] - field.x) / field.resolution, 0), columns - 2))
        return not reaches((row, column), (low, left), field.values[0], self._footprint.inscribed)

    def settle(self, around: Surroundings, pose: np.ndarray) -> bool:
        """
        Return whether the way that has been drawn from a pose is the one to drive.

        Where it is long for its width, room and turns have made it so, and it is drawn once more.
        """
        if self.is_settled or self._now is None or self.left(pose) == math.inf:
            return True
        way = self._way_from(self._now, pose)
        length = _length(way)
        if self._easy is None:
            width = self._footprint.inscribed
            is_far = length > _FAR or not around.grid.has(self.goal[:2])
            if is_far or length <= _LONG * shortest(self.goal, pose, around, width):
                self.is_settled = True
                return True
            self._easy, self._taste = self._now, SHORT
            self.draw(around)
            return False
        easy, self._easy, self.is_settled = self._easy, None, True
        clear = min(_CLEAR, self._clearance(around, self._way_from(easy, pose), _CLEAR))
        is_near = self._clearance(around, way, _CLEAR) < clear
        if is_near or length > _SHORTER * _length(self._way_from(easy, pose)):
            self._now, self._taste = easy, EASY
        return True

    def keep_up(self, around: Surroundings, pose: np.ndarray, dt: float) -> float:
        """Bring all up to date, `dt` [s] after the last time, and return what is left [m]."""
        is_stale = around.distances is not None and around.revision != self._drawn
        self._since_drawn += dt
        # What is drawn because the way is blocked is drawn to its end; all else gives way to it.
        is_free = not (self.is_drawing and self._is_urgent)
        if is_stale and is_free and self._since_drawn >= _REDRAW_BLOCKED:
            is_bad = self.is_blocked(around) or self.left(pose) == math.inf
            if is_bad or (self._since_drawn >= _REDRAW and not self.is_drawing):
                self.aim(around, pose)
                self.draw(around)
                self._is_urgent = is_bad
        # A step that has measured all distances draws no more than it has to.
        share = AT_ONCE if self.is_drawing and self._is_urgent else 1.0
        self.work(pose, round(share * SLICE) if self._since_drawn > 0.0 else 0)
        left = self.left(pose)
        if left < math.inf:
            self.lead_from(pose)
        elif not self.is_drawing:
            self._look_beyond(pose)
        return left

    @property
    def is_drawing(self) -> bool:
        """Whether there will be better values soon."""
        return self._next is not None or not (self._overview is None or self._overview.is_done)

    @property
    def values(self) -> Field | None:
        """The values; None until there are any."""
        return None if self._now is None else self._now.values

    def left(self, pose: np.ndarray) -> float:
        """Return what is left from a pose [m of free way]; infinite when no way leads there."""
        assert self._now is not None
        value: float = value_at(self._now.values, np.append(pose, np.zeros(3)))
        return value if value < self._now.beyond - 1e-3 else math.inf

    def lead_from(self, pose: np.ndarray) -> None:
        """Set `way` from a pose: what is left of it, or another one."""
        assert self._now is not None
        if len(self.way):
            apart = np.hypot(*(self.way[:_PASSED, :2] - pose[:2]).T)
            nearest = int(apart.argmin())
            if apart[nearest] < _OFF_WAY:
                self.way = self.way[nearest:]
                return
        self.way = self._way_from(self._now, pose)

    def is_blocked(self, around: Surroundings) -> bool:
        """Whether something is in the way that was not there when the way was drawn."""
        least = 0.25 * self._parameters.margin
        return self._clearance(around, self.way, least) < least

    def _clearance(self, around: Surroundings, way: np.ndarray, enough: float) -> float:
        circles = self._footprint.circles
        return float(least_clearance(around.distances, circles, way, enough))


def _length(way: np.ndarray) -> float:
    """Return the length of a way, shape (n, 3) [m]."""
    return float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum())


def border_of(around: Surroundings, overview: Overview) -> np.ndarray:
    """
    Return the ways left from the cells at the border of the window on a map, float32.

    They are infinite in all other cells, and where the map ends.
    """
    shape, all_ = around.grid.cells.shape, around.whole.cells.shape
    border = np.full(shape, np.inf, np.float32)
    row, column = around.corner
    # Two cells, as a lattice has every other one.
    for at in (0, 1):
        sides: tuple[tuple[bool, Any], ...] = (
            (row > 0, (at, slice(None))),
            (row + shape[0] < all_[0], (shape[0] - 1 - at, slice(None))),
            (column > 0, (slice(None), at)),
            (column + shape[1] < all_[1], (slice(None), shape[1] - 1 - at)),
        )
        for goes_on, cells in sides:
            if goes_on:
                border[cells] = 0.0
    begun = np.argwhere(border == 0.0)
    border[tuple(begun.T)] = overview.at(around.grid.to_points(begun))
    return border
