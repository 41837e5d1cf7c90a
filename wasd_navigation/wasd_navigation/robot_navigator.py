# SPDX-License-Identifier: Apache-2.0
"""A navigator with a robot's senses, without ROS: odometry and scans by their times, goals."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry

from wasd_navigation.exploring import Explorer
from wasd_navigation.mapping import save_map, save_session, session_output
from wasd_navigation.mapping.map_file import without_ending
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.navigator import Navigator, Outcome, REPLACED
from wasd_navigation.odometry import Odometry
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_keepout, make_parts, make_pilot, Parts
from wasd_navigation.records import Scan
from wasd_navigation.senses import Senses
from wasd_navigation.traversability import Traversability
from wasd_navigation.waypoints import Waypoints

# While it explores it looks so often whether it has seen enough on its way to a frontier [s].
EXPLORE_PERIOD = 0.5


class RobotNavigator:
    """
    Maps or localises with odometry and scans as they come, and drives to one goal at a time.

    Times are told [s]. `send` takes what is commanded, (vx, vy, wz), shape (3,) [m/s], [rad/s];
    `say` messages to a driver, `warn` errors of input. `refusal` says why nothing can be driven to
    now. `on_scan` are called with the time and the odometry of each scan that was used, `on_reset`
    when all that was known is old.
    """

    navigator: Navigator

    def __init__(
        self,
        settings: NavigatorParameters | None = None,
        parts: Parts | None = None,
        inform: Callable[[str], Any] = lambda words: None,
    ) -> None:
        """
        Take parameters, and what maps and drives where these are not to make it.

        `inform` hears when it takes a while to compile that.

        Raises:
            UserError: the map cannot be read.
        """
        self.send: Callable[[np.ndarray], None] = lambda velocity: None
        self.say: Callable[[str], Any] = lambda words: None
        self.warn: Callable[[str], Any] = lambda words: None
        self.refusal: Callable[[], str] = lambda: ''
        self.on_scan: list[Callable[[float, Odometry], None]] = []
        self.on_reset: list[Callable[[], None]] = []
        self.locks: set[str] = set()  # what stops every goal while it is on
        self.senses = Senses()
        self.senses.on_scan = self._see
        self.senses.warn = lambda words: self.warn(words)
        self._notice = ''
        self._ground: Traversability | None = None
        # What chooses goals, one for each request; None: nothing does.
        self.explorer: Explorer | None = None
        self._waypoints: Waypoints | None = None
        self._home = np.zeros(3)  # where it began to explore
        self._explored = 0.0  # since it has looked for another frontier [s]
        self._stepped_at: float | None = None
        self._inform = inform
        self._begin(settings or NavigatorParameters(), parts)

    def configure(self, settings: NavigatorParameters) -> None:
        """Begin with parameters, also with those that only hold from the start."""
        if settings != self.settings:
            self._begin(settings, None)

    def _begin(self, settings: NavigatorParameters, parts: Parts | None) -> None:
        self.settings = settings
        parts = parts or make_parts(settings, self._inform)
        explorer = Explorer(settings.footprint, settings.planning)
        keepout = make_keepout(settings)
        self.navigator = Navigator(*parts, settings.planning.silence, explorer, keepout)
        self.navigator.on_end.append(self._on_end)
        self.use_ground(self._ground)

    def use_ground(self, ground: Traversability | None) -> None:
        """Use this knowledge of the ground, or none, from now on."""
        self._ground = self.navigator.ground = ground
        self.senses.is_ground = None if ground is None else ground.is_ground

    def tune(self, settings: NavigatorParameters) -> None:
        """Take other parameters; what drives is made again, and stands before."""
        before, self.settings = self.settings, settings
        if (before.limits, before.planning) != (settings.limits, settings.planning):
            self.stop('the driving parameters have changed')
            self.navigator.configure(make_pilot(settings), settings.planning.silence)

    def take_odometry(
        self, now: float, base: BaseOdometry, frames: tuple[str, str] = ('', '')
    ) -> None:
        """Take where the base is at a time; `frames` are odom's and the base's, '' as before."""
        odometry = self.senses.read_odometry(now, base, frames)
        if odometry is None:
            return
        if self.navigator.move(odometry):
            self.senses.forget_odometry(now)
            self.warn('odom: has jumped (was it reset?)')
            self.stop('odometry has leapt')
        self.senses.add_odometry(now, odometry)

    def _see(self, scan: Scan, odometry: Odometry, age: float, now: float) -> None:
        self.navigator.see(scan, odometry, age)
        for tell in self.on_scan:
            tell(now, odometry)

    def step(self, now: float) -> float | None:
        """
        Command a velocity where there is a goal.

        Return the time since the last call [s]; None when it has jumped back.
        """
        before, self._stepped_at = self._stepped_at, now
        dt = 0.0 if before is None else now - before
        if dt < 0.0:
            self.reset(f'time has jumped back by {-dt:.3g} s')
            return None
        if self.navigator.goal is not None and (why := self.refusal()):
            self.stop(why)
        if self.explorer is not None:
            self._explore(self.explorer, dt)
        elif (
            self._waypoints is not None
            and self.navigator.goal is None
            and not self._waypoints.rest(dt)
        ):
            self._drive_on(self._waypoints)
        velocity = self.navigator.step(dt)
        if velocity is not None:
            self.send(velocity)
        if self._notice != (notice := self.navigator.notice):
            self._notice = notice
            if notice:
                self.say(notice)
        return dt

    def go(self, goal: np.ndarray) -> None:
        """Drive to T_map_goal, shape (3,), whose yaw may be NaN: see `Navigator.set_goal`."""
        if refusal := self.no_driving or self._refusal_of(goal):
            self.stop(REPLACED)
            self.navigator.refuse(refusal, goal)
        else:
            self._begin_another()
            self.navigator.set_goal(goal)

    def refuse(self, why: str) -> None:
        """End what it was doing, and take no other goal, because of something."""
        self._begin_another()
        self.navigator.refuse(why)

    def _begin_another(self) -> None:
        """End what chose the goal, exploring or waypoints, before another goal."""
        self.explorer = None
        self._end_waypoints(Outcome('cancelled', REPLACED))

    @property
    def no_driving(self) -> str:
        """Why nothing can be driven to now, '' where it can."""
        return ' and '.join(f'{lock} is on' for lock in sorted(self.locks)) or self.refusal()

    def _refusal_of(self, goal: np.ndarray) -> str:
        """Why keepout areas forbid a goal, '' where they do not."""
        keepout = self.navigator.keepout
        if keepout is None or not keepout.has(goal[:2]):
            return ''
        return f'({goal[0]:.2f}, {goal[1]:.2f}) is in a keepout area: choose a place outside it'

    def follow(self, waypoints: Waypoints) -> None:
        """Drive to goals one after another, from now on."""
        self._begin_another()
        if refusal := self.no_driving:
            self.stop(REPLACED)
            self.navigator.refuse(refusal, waypoints.begin())
            waypoints.tell(Outcome('refused', refusal))
        else:
            self.navigator.cancel(REPLACED)
            self._waypoints = waypoints
            self._drive_on(waypoints)

    @property
    def is_following(self) -> bool:
        """Whether it drives to goals one after another."""
        return self._waypoints is not None

    def _drive_on(self, waypoints: Waypoints) -> None:
        """Drive to the next waypoint."""
        if refusal := self.no_driving:
            self._end_waypoints(Outcome('cancelled', refusal))
            return
        goal = waypoints.begin()
        if refusal := self._refusal_of(goal):
            self.navigator.refuse(refusal, goal)
        else:
            self.navigator.set_goal(goal)

    def _end_waypoints(self, outcome: Outcome) -> None:
        """Forget the waypoints that are left, and tell why."""
        waypoints, self._waypoints = self._waypoints, None
        if waypoints is not None:
            waypoints.tell(outcome)

    @property
    def is_exploring(self) -> bool:
        """Whether it looks for goals itself."""
        return self.explorer is not None

    def explore(self) -> None:
        """
        Drive to frontiers of the unknown, until none is left that can be reached; then back.

        Raises:
            UserError: its map does not grow, or nothing can be driven to now.
        """
        if refusal := self.no_driving:
            raise UserError(f'cannot explore: {refusal}')
        if not self.navigator.is_mapping:
            raise UserError('exploring makes a map: this one was saved, and stays as it is')
        self.stop('it explores from now on')
        self.explorer = Explorer(self.settings.footprint, self.settings.planning)
        self._is_homeward = self._has_begun = False
        self.say('explores')

    def _explore(self, explorer: Explorer, dt: float) -> None:
        """Set the next goal where the last one is done with, or seen from afar."""
        navigator, pose = self.navigator, self.navigator.pose
        if pose is None or not navigator.is_placed or self.refusal():
            return
        if not self._has_begun:
            # It returns to its start, or to where it has left the keepout area around that.
            self._home, self._has_begun = pose.copy(), not navigator.is_kept_out
        self._explored += dt
        is_driving = navigator.goal is not None
        if is_driving and (self._is_homeward or self._explored < EXPLORE_PERIOD):
            return
        self._explored = 0.0
        is_seen = explorer.is_seen(navigator.grid, pose)
        if is_driving and not is_seen:
            return
        if self._is_homeward:
            self.explorer = None
            self.say('explored: no more of the unknown can be reached or is worth the way')
            return
        if not is_seen:
            explorer.give_up()  # it has been there, or no way leads there
        goal = explorer.choose(navigator.grid, pose, home=self._home)
        self._is_homeward = goal is None
        navigator.set_goal(self._home if goal is None else goal)

    def stop(self, why: str) -> bool:
        """Cancel the goal and command standstill; return whether there was a goal."""
        self.explorer = None
        was_driving = self.give_up(why)
        if was_driving:
            self.stand()
        return was_driving

    def give_up(self, why: str) -> bool:
        """Cancel the goal, and waypoints also between two goals; return whether it drove."""
        was_driving = self.navigator.cancel(why)
        self._end_waypoints(Outcome('cancelled', why))
        return was_driving

    def stand(self) -> None:
        """Command standstill."""
        self.send(np.zeros(3))

    def lock(self, name: str, is_on: bool) -> None:
        """Stop, and refuse goals while a lock is on."""
        (self.locks.add if is_on else self.locks.discard)(name)
        if is_on:
            self.stop(f'{name} is on')

    def reset(self, why: str = 'the robot was put back to its start') -> None:
        """Stand and know of nothing, because of something."""
        self.begin_map(why)
        self.senses.reset()
        self._stepped_at = None

    def begin_map(self, why: str = 'a new map begins') -> None:
        """Stand and map from here, as if nothing had been seen."""
        self.stop(why)
        self.navigator.reset()
        for tell in self.on_reset:
            tell()

    def save_map(self, name: str) -> str:
        """
        Write the map to NAME.yaml and NAME.pgm; return words that say so.

        Of a map of its own the places, with which another day goes on, to NAME.places.npz; those
        of another map that was there are removed.

        Raises:
            UserError: there is none yet, or it cannot be written.
        """
        if not self.navigator.scans:
            raise UserError('no map yet: no scan has come')
        locator = self.navigator.locator
        text, picture = save_map(locator.grid, Path(name))
        if not isinstance(locator, Mapper):
            if without_ending(text).resolve() == without_ending(Path(self.settings.map)).resolve():
                return f'map in {text} and {picture.name}'
            session_output(text).path.unlink(missing_ok=True)
            return f'map in {text} and {picture.name}, without places: it cannot be continued'
        places = save_session(locator.session, Path(name))
        return f'map in {text}, {picture.name} and {places.name}'

    def _on_end(self, outcome: Outcome) -> None:
        if self.is_exploring and outcome.state == 'cancelled':
            return  # it has seen enough from afar
        self.say(': '.join(filter(None, (f'goal {outcome.state}', outcome.reason))))
        if self._waypoints is not None and (end := self._waypoints.end(outcome)) is not None:
            self._end_waypoints(end)
