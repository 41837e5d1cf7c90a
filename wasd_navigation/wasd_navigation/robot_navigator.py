# SPDX-License-Identifier: Apache-2.0
"""A navigator with a robot's senses, without ROS: odometry and scans by their times, goals."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

import numpy as np
from wasd_core.errors import InvalidMessage, UserError
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import Pose

from wasd_navigation.mapping import save_map
from wasd_navigation.navigator import Navigator, Outcome
from wasd_navigation.odometry import Odometry, OdometryMemory, read_odometry
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_parts, make_pilot, Parts
from wasd_navigation.records import Ranges, read_ranges

# Scans may come without odometry for so long, before that is said [s].
PATIENCE = 5.0


class RobotNavigator:
    """
    Maps or localises with odometry and scans as they come, and drives to one goal at a time.

    Times are told [s]. `send` takes what is commanded, (vx, vy, wz), shape (3,) [m/s], [rad/s];
    `say` what is said to a driver, `warn` what is wrong with what came. `refusal` says why nothing
    can be driven to now. `on_scan` are called with the time and the odometry of each scan that
    was used, `on_reset` when all that was known is old.
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
        self.odom_frame, self.base_frame = 'odom', ''
        self._memory = OdometryMemory()
        self._waiting: tuple[float, Ranges, str] | None = None  # for odometry, and its frame
        self._notice = ''
        self._fixed: dict[str, tuple[str, Pose]] = {}  # child: parent and the pose in it
        self._stepped_at: float | None = None
        self._baseless_since = math.inf  # scans have come without odometry
        self._inform = inform
        self._begin(settings or NavigatorParameters(), parts)

    def configure(self, settings: NavigatorParameters) -> None:
        """Begin with parameters, also with those that only hold from the start."""
        if settings != self.settings:
            self._begin(settings, None)

    def _begin(self, settings: NavigatorParameters, parts: Parts | None) -> None:
        self.settings = settings
        parts = parts or make_parts(settings, self._inform)
        self.navigator = Navigator(*parts, settings.planning.silence)
        self.navigator.on_end.append(self._on_end)

    def tune(self, settings: NavigatorParameters) -> None:
        """Take other parameters; what drives is made again, and stands before."""
        before, self.settings = self.settings, settings
        if (before.limits, before.planning) != (settings.limits, settings.planning):
            self.stop('how to drive has changed')
            self.navigator.configure(make_pilot(settings), settings.planning.silence)

    def place_frame(self, child: str, parent: str, pose: Pose) -> None:
        """Take where a frame is that never moves in its parent: the lidar's is such a one."""
        self._fixed[child.lstrip('/')] = parent.lstrip('/'), pose

    def mount_of(self, frame: str) -> Pose | None:
        """Return the pose of the lidar's frame in the base, None where it is not known yet."""
        frame, pose = frame.lstrip('/'), Pose(np.zeros(3), np.eye(3))
        begin, base = frame, self.base_frame.lstrip('/')
        for _ in range(len(self._fixed) + 1):  # no more: frames may go round in a circle
            if frame == base:
                return pose
            if frame not in self._fixed:
                break
            frame, step = self._fixed[frame]
            pose = step @ pose
        self.warn(f'scan waits: no way from {begin!r} to the base {base!r} on /tf_static')
        return None

    def age(self, now: float) -> float:
        """Return how long before the newest odometry a time was [s]; NaN: there is none."""
        return self._memory.age(now)

    def take_odometry(
        self, now: float, base: BaseOdometry, frames: tuple[str, str] = ('', '')
    ) -> None:
        """Take where the base is at a time; `frames` are odom's and the base's, '' as before."""
        try:
            odometry = read_odometry(base)
        except InvalidMessage as error:
            self.warn(f'odom: {error}: ignored')
            return
        self.odom_frame = frames[0] or self.odom_frame
        self.base_frame = frames[1] or self.base_frame
        if self._memory.age(now) == 0.0:
            return  # said before: no sign of life
        if self.navigator.move(odometry):
            self._memory.clear()
            self.warn('odom: has leapt, as if it was set anew')
            self.stop('odometry has leapt')
        self._memory.add(now, odometry)
        if self._waiting is not None:
            late, self._waiting = self._waiting, None
            self.take_scan(*late)

    def take_scan(self, now: float, ranges: Ranges, frame: str) -> None:
        """Take a scan of a time in the lidar's frame; it waits for odometry of that time."""
        if not self.base_frame:
            # Scans may come before odom: a word only where that lasts.
            self._baseless_since = min(self._baseless_since, now)
            if now - self._baseless_since > PATIENCE:
                self.warn('scan waits for odom, which names the base')
        mount = self.mount_of(frame) if self.base_frame else None
        odometry, age = self._memory.at(now), self._memory.age(now)
        if odometry is None and age > 0.0:
            self.warn(f'scan is {age:.1f} s old, before all odometry that is kept: ignored')
        elif odometry is None:
            self._waiting = now, ranges, frame
            if age < -1.0:
                self.warn(f'scan is {-age:.1f} s ahead of odometry: it waits')
        elif mount is not None:
            try:
                scan = read_ranges(ranges, odometry.level @ mount)
            except InvalidMessage as error:
                self.warn(f'scan: {error}: ignored')
                return
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
        refusal = ' and '.join(f'{lock} is on' for lock in sorted(self.locks)) or self.refusal()
        if refusal:
            self.stop('another goal has come')
            self.navigator.refuse(refusal, goal)
        else:
            self.navigator.set_goal(goal)

    def stop(self, why: str) -> bool:
        """Cancel the goal and command standstill; return whether there was a goal."""
        was_driving = self.navigator.cancel(why)
        if was_driving:
            self.stand()
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
        self._memory.clear()
        self._waiting = self._stepped_at = None

    def begin_map(self, why: str = 'the map begins anew') -> None:
        """Stand and map from here, as if nothing had been seen."""
        self.stop(why)
        self.navigator.reset()
        for tell in self.on_reset:
            tell()

    def save_map(self, name: str) -> str:
        """
        Write the map to NAME.yaml and NAME.pgm; return words that say so.

        Raises:
            UserError: there is none yet, or it cannot be written.
        """
        if not self.navigator.scans:
            raise UserError('no map yet: no scan has come')
        text, picture = save_map(self.navigator.locator.grid, Path(name))
        return f'map in {text} and {picture.name}'

    def _on_end(self, outcome: Outcome) -> None:
        self.say(': '.join(filter(None, (f'goal {outcome.state}', outcome.reason))))
