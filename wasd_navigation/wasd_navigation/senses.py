# SPDX-License-Identifier: Apache-2.0
"""Pairs scans with the odometry of their time."""

from collections.abc import Callable, Mapping
from functools import partial
import math
from typing import Any

import numpy as np
from wasd_core.errors import InvalidMessage
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import Pose

from wasd_navigation.odometry import moves_between, Odometry, OdometryMemory, read_odometry
from wasd_navigation.records import IsGround, Ranges, read_ranges, Scan
from wasd_navigation.se2 import transform

# Scans may come without odometry for so long, before that is said [s].
PATIENCE = 5.0


class Senses:
    """
    Reads odometry and scans as they come; a scan waits for the odometry of its time.

    Times are told [s]. `on_scan` gets each scan, the odometry of its time, which is half way
    between its first ray and its last, the age [s] of its last ray, and that time; `warn` hears
    errors of input. `odom_frame` and `base_frame` are named by odometry. `is_ground`
    says, in the frame of odometry, which rays end on ground that is no obstacle.
    """

    def __init__(self) -> None:
        self.warn: Callable[[str], Any] = lambda words: None
        self.on_scan: Callable[[Scan, Odometry, float, float], Any] = lambda *_: None
        self.is_ground: IsGround | None = None
        self.odom_frame, self.base_frame = 'odom', ''
        self._memory = OdometryMemory()
        self._waiting: tuple[float, Ranges, str] | None = None  # for odometry, and its frame
        self._fixed: dict[str, tuple[str, Pose]] = {}  # child: parent and the pose in it
        self._baseless_since = math.inf  # scans have come without odometry
        self._leapt_at = -math.inf  # odometry has

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
        self.warn(f'scan waits: no transform from {begin!r} to the base {base!r} on /tf_static')
        return None

    def age(self, now: float) -> float:
        """Return how long before the newest odometry a time was [s]; NaN: there is none."""
        return self._memory.age(now)

    def read_odometry(
        self, now: float, base: BaseOdometry, frames: tuple[str, str] = ('', '')
    ) -> Odometry | None:
        """
        Return odometry of a time; None where it is none, or was said before.

        `frames` are odom's and the base's, '' as before.
        """
        try:
            odometry = read_odometry(base)
        except InvalidMessage as error:
            self.warn(f'odom: {error}: ignored')
            return None
        self.odom_frame = frames[0] or self.odom_frame
        self.base_frame = frames[1] or self.base_frame
        # Said before: no sign of life.
        return None if self._memory.age(now) == 0.0 else odometry

    def add_odometry(self, now: float, odometry: Odometry) -> None:
        """Remember odometry of a time, and take the scan that has waited for it."""
        self._memory.add(now, odometry)
        if self._waiting is not None:
            late, self._waiting = self._waiting, None
            self.take_scan(*late)

    def take_measured(self, frame: str, now: float, fields: Mapping[str, Any]) -> None:
        """Take a scan by its fields, as a lidar of a simulation measures it: see `take_scan`."""
        self.take_scan(now, Ranges(*(fields[name] for name in Ranges._fields)), frame)

    def take_scan(self, now: float, ranges: Ranges, frame: str) -> None:
        """Take a scan of a time in the lidar's frame; it waits for odometry of that time."""
        if not self.base_frame:
            # Scans may come before odom: a word only where that lasts.
            self._baseless_since = min(self._baseless_since, now)
            if now - self._baseless_since > PATIENCE:
                self.warn('scan waits for odom, which names the base')
        mount = self.mount_of(frame) if self.base_frame else None
        try:
            times = now + ranges.times
        except InvalidMessage as error:
            self.warn(f'scan: {error}: ignored')
            return
        begin, end = (float(times[0]), float(times[-1])) if len(times) else (now, now)
        age = self._memory.age(end)
        if self._memory.at(end) is None:
            if age > 0.0:
                self.warn(f'scan is {age:.1f} s old, before all odometry that is kept: ignored')
                return
            self._waiting = now, ranges, frame
            if age < -1.0:
                self.warn(f'scan is {-age:.1f} s ahead of odometry: it waits')
        elif mount is not None and now >= self._leapt_at:
            self._read(ranges, times, mount, 0.5 * (begin + end), age)

    def _read(
        self, ranges: Ranges, times: np.ndarray, mount: Pose, middle: float, age: float
    ) -> None:
        """Give a scan on as it looks from where the base was half way through it."""
        odometry = self._memory.at(max(middle, self._memory.oldest))
        assert odometry is not None
        moved = None
        if ranges.time_increment > 0.0:
            moved = moves_between(odometry.pose, self._memory.poses(times))
        try:
            is_ground = None if self.is_ground is None else partial(self._is_ground, odometry.pose)
            scan = read_ranges(ranges, odometry.level @ mount, moved, is_ground)
        except InvalidMessage as error:
            self.warn(f'scan: {error}: ignored')
            return
        self.on_scan(scan, odometry, age, middle)

    def _is_ground(self, pose: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Ask `is_ground` for rays of the level frame below a base with a pose, shape (3,)."""
        assert self.is_ground is not None
        placed = np.column_stack((transform(pose, ends[:, :2].copy()), ends[:, 2]))
        return self.is_ground(transform(pose, begins), placed)

    def forget_odometry(self, now: float) -> None:
        """Forget where the robot was before odometry leapt, at a time [s]."""
        self._memory.clear()
        self._leapt_at = now

    def reset(self) -> None:
        """Forget what was sensed; frames stay where they are."""
        self._memory.clear()
        self._waiting = None
        self._leapt_at = -math.inf
