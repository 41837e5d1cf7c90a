# SPDX-License-Identifier: Apache-2.0
"""`--map`: the navigator of a run, which drives the robot until another source does."""

from collections.abc import Callable, Sequence
import itertools
import logging
import math
from typing import Any

import numpy as np
from wasd_cockpit.link import Navigation, PlanarPose
from wasd_core.errors import UserError
from wasd_core.parameters import known_parameters, numeric_ends
from wasd_core.timing import TWIST_RATE
from wasd_navigation.exploring import Explorer
from wasd_navigation.navigator import Navigator, Outcome
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.records import Grid
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.waypoints import Waypoints

from wasd_bringup.run.go2 import Go2
from wasd_bringup.run.ground import Ground
from wasd_bringup.run.robot import Robot
from wasd_bringup.run.sensing import lidar_of, listen_to_lidar, margin_of, size_of

# By this name it takes the robot.
SOURCE = 'navigator'
# Why its goals are cancelled at the end of the run.
ENDS = 'the navigator ends'
# The page gets a new map so often at most [s].
PICTURE_PERIOD = 1.0
# Maps of a process have different numbers: the page shows those of several robots in turn.
_NUMBERS = itertools.count()


class NavigationDriver:
    """
    Maps with the robot's lidar and odometry, and drives it to goals, in simulated time.

    Whatever a driver does, a key, a stick, a velocity on cmd_vel, a pause, ends the goal and those
    that were to follow it. So does TAB, which gives the keys to another robot, and the loss of the
    page that asked for it. `on_step` hear when it has stepped.
    """

    def __init__(self, robot: Robot) -> None:
        """
        Take the robot.

        Raises:
            UserError: the robot has no odometry or no lidar, or the map cannot be read.
        """
        if not robot.has_odometry:
            raise UserError(f'--map: nothing estimates where {robot.name} is: no map without that')
        self.robot = robot
        self._options = robot.options
        self._goals = self._options.goals  # once the robot follows velocities
        self._explores = self._options.explore  # once the robot follows velocities
        self._is_of_page = False  # the goal that is driven to
        self._page_explorer: Explorer | None = None  # that the page has asked for
        self._ended: list[dict[str, Any]] = []
        self._cure = ''  # what the robot refused the last goal with
        self._is_cured = False
        # Revisions of map and ground, time, number and map.
        self._pictured: tuple[tuple[int, int], float, int, Grid] | None = None
        self.on_step: list[Callable[[float, float], None]] = []
        tag = lidar_of(robot)
        self.given = _settings(robot)
        inform = logging.getLogger('wasd.navigator').info
        self.unit = RobotNavigator(NavigatorParameters().changed(self.given), inform=inform)
        self.unit.send = self._send
        self.unit.say = robot.say
        self.unit.refusal = lambda: robot.refusal
        robot.simulation.on_reset += [self.unit.reset, lambda: self._cancel('a reset')]
        self._ground: Ground | None = None
        if isinstance(robot, Go2) and robot.elevation.mapper is not None:
            self._ground = Ground(robot, self.unit)
        robot.drivers.on_take.append(self._give_way)
        listen_to_lidar(robot, tag, self.unit.senses, self._tell_odometry)

    def prepare(self) -> None:
        """Apply the settings, before anything is scheduled."""
        # Before what tells of the goals after it.
        self.navigator.on_end.insert(0, self._on_end)

    @property
    def navigator(self) -> Navigator:
        """What maps, and drives to a goal."""
        return self.unit.navigator

    @property
    def first_line(self) -> str:
        """The first line for the user."""
        is_known = self._options.map and not self._options.continues
        what = 'in a map' if is_known else 'maps'
        of_several = ' the selected robot, TAB the one it leaves' * bool(self.robot.world.prefix)
        begin = "click a goal on the page's Map, or send goal_pose"
        waits = 'exploring' if self._explores else 'the goal' if self._goals else ''
        if waits and self.robot.refusal:
            begin = f'{waits} waits: {self.robot.refusal.partition(":")[0]}'
        return f'{what}: {begin}; any key takes over{of_several}'

    def go(self, goal: Sequence[float], from_page: bool = False) -> None:
        """
        Drive to x, y [m] and yaw [rad] of the map; a yaw of NaN is that of the way.

        A goal `from_page` counts while the page does: see `lose_page`.
        """
        self.unit.go(np.array(goal))
        self._is_of_page = from_page and self.navigator.goal is not None

    def explore(self, from_page: bool = False) -> None:
        """
        Map by itself; one `from_page` goes on while the page does.

        Raises:
            UserError: it drives in a saved map, or cannot drive now.
        """
        self.unit.explore()
        self._page_explorer = self.unit.explorer if from_page else None

    @property
    def no_exploring(self) -> str:
        """Why it cannot explore now, '' where it can."""
        if not self.navigator.is_mapping:
            return 'the map was saved, and stays as it is'
        return 'it explores' if self.unit.is_exploring else self.unit.no_driving

    def lose_page(self) -> None:
        """End a goal that the page has asked for: nobody sees any more where it leads."""
        explores = self.unit.is_exploring and self.unit.explorer is self._page_explorer
        if self._is_of_page or explores:
            self.unit.stop('the page is gone')

    def leave(self) -> None:
        """End a goal when the keys go to another robot: none would end it then."""
        self._cancel('the keys go to another robot')

    def look(self) -> None:
        """End a goal when time is made to stand still."""
        if self.robot.simulation.paused:
            self._cancel('paused')

    def repeat(self) -> None:
        """Navigate for one period; called at TWIST_RATE of simulated time."""
        self._tell_odometry()
        if self._ground is not None:
            self._ground.step()
        is_free = self.navigator.goal is None and not self.robot.refusal
        if self._explores and is_free and self.navigator.is_placed:
            self._explores = False
            try:
                self.unit.explore()
            except UserError as error:
                self.robot.say(str(error))
        is_free = is_free and not self.unit.is_exploring
        if self._goals and is_free and self.navigator.is_placed:
            goals, self._goals = list(map(np.array, self._goals)), ()
            rounds = None if self._options.patrol else 1
            waypoints = Waypoints(goals, rounds=rounds)
            waypoints.tell = lambda outcome: self._end_goals(waypoints, outcome)
            self.unit.follow(waypoints)
        self.robot.mute(self.navigator.goal is not None or self.unit.is_following)
        # As a stamp tells it, so that a navigator over topics computes the same.
        now = 1e-9 * round(1e9 * self.robot.world.time)
        dt = self.unit.step(now)
        if dt is not None:
            for tell in self.on_step:
                tell(now, dt)

    def disarm(self) -> None:
        """Cancel the present goal, exploring, and every goal that waits."""
        self._cancel('stopped by hand', also_refused=True)

    def save(self) -> None:
        """
        Write the map, by the name of --save-map or else `map`; of several robots as `NAME_map`.

        Raises:
            UserError: there is none yet, or it cannot be written.
        """
        self.robot.say(self.unit.save_map(self.unit.settings.save_map))

    def view(self) -> Navigation | None:
        """Return what the page shows; None before there is a map."""
        navigator, now = self.navigator, self.robot.world.time
        pose = navigator.pose
        if not navigator.scans or pose is None:
            self._pictured = None
            return None
        ground = 0 if navigator.ground is None else navigator.ground.revision
        revision = navigator.locator.revision, ground
        if self._pictured is None or (
            self._pictured[0] != revision and now >= self._pictured[1] + PICTURE_PERIOD
        ):
            grid, keepout = navigator.seen, navigator.keepout
            grid = grid if keepout is None else keepout.shown_on(grid)
            self._pictured = revision, now, next(_NUMBERS), grid
        _, _, number, grid = self._pictured
        goal, state, reason = navigator.goal, navigator.state, navigator.reason
        self._is_cured = self._is_cured or self._cure != self.robot.refusal
        if reason and reason == self._cure and self._is_cured:
            state, reason = 'idle', ''
        return Navigation(
            number=number,
            cells=grid.cells,
            resolution=grid.resolution,
            origin=grid.origin,
            pose=PlanarPose(*pose.tolist()),
            path=navigator.pilot.path[:, :2],
            goal=None if goal is None else PlanarPose(*goal.tolist()),
            state=state,
            reason=reason or navigator.notice,
            no_exploring=self.no_exploring,
            is_following=self.unit.is_following,
        )

    def report(self) -> dict[str, Any]:
        """Return what a report tells of it."""
        locator = self.navigator.locator
        rows, columns = locator.grid.cells.shape if self.navigator.scans else (0, 0)
        pose = self.navigator.pose
        return {
            'scans': self.navigator.scans,
            'closures': int(getattr(locator, 'closures', 0)),
            'size': [rows, columns],
            'pose': None if pose is None else pose.tolist(),
            'state': self.navigator.state,
            'goals': self._ended,
        }

    def close(self) -> None:
        """
        End, and write the map where that was asked for.

        Raises:
            UserError: it cannot be written.
        """
        self.unit.stop(ENDS)
        why = self.robot.refusal or self.navigator.missing or 'there was no time for it'
        goals, self._goals = self._goals, ()
        for goal in goals:
            self._record(goal, Outcome('failed', f'it never began: {why}'))
        if self._options.save_map:
            self.save()

    def _send(self, velocity: np.ndarray) -> None:
        vx, vy, wz = velocity.tolist()
        self.robot.drive((vx, vy, wz), SOURCE)

    def _give_way(self, source: str, what: str) -> None:
        if source != SOURCE:
            self._cancel(f'{what} takes over')

    def _cancel(self, why: str, also_refused: bool = False) -> None:
        """
        Stop, and cancel what waits to begin.

        While the robot refuses velocities, keys may be on the way to make it follow them: then
        what waits is kept, but with `also_refused`.
        """
        self.unit.stop(why)
        if not (self._goals or self._explores) or (self.robot.refusal and not also_refused):
            return
        goals, self._goals, self._explores = self._goals, (), False
        for goal in goals:
            self._record(goal, Outcome('cancelled', why))
        self.robot.say(f'{"the goal" if goals else "exploring"} is cancelled: {why}')

    def _end_goals(self, waypoints: Waypoints, outcome: Outcome) -> None:
        """Record the goals that were not begun; those that the end of the run leaves: `close`."""
        if self._options.patrol:
            if outcome.state == 'failed':
                self.robot.say(f'the patrol ends: {outcome.reason}')
        elif outcome.reason == ENDS:
            self._goals = tuple(goal.tolist() for goal in waypoints.left)
        else:
            for goal in waypoints.left:
                self._record(goal.tolist(), outcome)

    def _tell_odometry(self) -> None:
        odometry = self.robot.odometry
        if odometry is not None:
            now = self.robot.world.time
            self.unit.take_odometry(now, odometry, self.robot.frames)

    def _on_end(self, outcome: Outcome) -> None:
        self._is_of_page = False
        self._cure = outcome.reason if outcome.reason == self.robot.refusal else ''
        self._is_cured = False
        self.robot.mute(False)
        self._record(self.navigator.last_goal.tolist(), outcome, self.navigator.elapsed)

    def _record(self, goal: Sequence[float], outcome: Outcome, took: float = 0.0) -> None:
        """Keep how a goal has ended, for the report."""
        pose, truth = self.navigator.pose, self.robot.world.base_since_start()
        x, y, _ = truth.position.tolist()
        self._ended.append(
            {
                't': round(self.robot.world.time, 9),
                'goal': [None if math.isnan(each) else each for each in goal],
                **outcome._asdict(),
                'took': round(took, 9),
                'pose': None if pose is None else pose.tolist(),
                'truth': [x, y, float(truth.rpy[2])],
                'recoveries': self.navigator.pilot.recoveries,
            }
        )


def _settings(robot: Robot) -> dict[str, Any]:
    """Return the navigator's parameters, by their names."""
    options = robot.options
    limits = {f'limits.{name}': most for name, most in robot.drive_limits.items()}
    values: dict[str, Any] = {
        'map': options.map or '',
        'continue_map': options.continues,
        'keepout': options.keepout or '',
        'control_frequency': TWIST_RATE,
        **size_of(robot),
        **{name: _allowed(name, most) for name, most in limits.items()},
    }
    margin = margin_of(robot)
    if margin is not None:
        values['planning.margin'] = margin
    if robot.world.prefix:
        # Of several robots each has a map of its own.
        values['map_frame'] = f'{robot.world.prefix}map'
        values['save_map'] = f'{robot.name}_map'
    if options.continues and options.map:
        values['save_map'] = options.map.removesuffix('.yaml')
    if options.save_map:
        values['save_map'] = options.save_map
    return values


def _allowed(name: str, value: float) -> float:
    """Return what of the navigator's parameter is nearest to a value: no robot is too slow."""
    low, high = numeric_ends(known_parameters(NavigatorParameters)[name].field)
    nearest: float = min(max(value, low), high)
    return nearest
