# SPDX-License-Identifier: Apache-2.0
"""The heights around a robot of a run, by its lidar of points and its odometry."""

from collections.abc import Callable
import math
from typing import Any

from quadruped_sim.elevation import Elevation
from quadruped_sim.elevation_mapper import ElevationMapper

from wasd_bringup.run.robot import Robot


class RobotElevation:
    """
    Maps in simulated time while one of those who are `wanted_by` wants it; costs nothing else.

    Where the legs begin to want it, it begins anew: how they walk does not depend on who looked
    before. `on_map` hear of a map with each cloud, with the cloud's time [s]; `clouds` is their
    count, `mapped_at` the last one's time. A robot without a lidar of points never has one.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot: Any = robot  # one with legs
        self.wanted_by: list[Callable[[], bool]] = []
        self.on_map: list[Callable[[Elevation, float], None]] = []
        self.mapper: ElevationMapper | None = None
        self.clouds, self.mapped_at = 0, math.inf
        self._is_for_legs, self._since = False, -math.inf  # when that began [s]
        self._start = 0  # the tick from which the mapper counts time, as sensors do
        topics = [topic for topic in robot.sensors.topics if topic.kind == 'PointCloud2']
        if topics:
            # On a joint that is held it stays where it is.
            self.mapper = ElevationMapper(topics[0].mount.in_base(robot.world))
            self._rate = topics[0].rate
            topics[0].listen(self._take, self._is_wanted)
            robot.simulation.on_reset.append(self._reset)

    def _reset(self) -> None:
        assert self.mapper is not None
        self._start = self._robot.world.tick
        self.mapper.reset()

    def prepare(self) -> None:
        """Begin anew where the legs' sight begins; to be called before each step of control."""
        was_for_legs, self._is_for_legs = self._is_for_legs, self._robot.legs.wants_map
        if self.mapper is not None and self._is_for_legs and not was_for_legs:
            self.mapper.reset()
            self._since = self._robot.world.time

    def step(self) -> None:
        """Take where the robot believes to be now; to be called after each step of control."""
        if self.mapper is None or not self._is_wanted():
            return
        robot = self._robot.legs.controller.robot  # `odometry` computes covariances, too: slower
        if robot is not None:
            world = self._robot.world
            # By ticks, so that the time after a reset has the same bits again.
            time = (world.tick - self._start) * world.time_step
            self.mapper.take_pose(time, robot.base.position, robot.orientation)

    def _is_wanted(self) -> bool:
        for wants in self.wanted_by:  # noqa: SIM110  # at each step: faster than `any`
            if wants():
                return True
        return False

    def _take(self, now: float, fields: dict[str, Any]) -> None:
        mapper, start = self.mapper, self._start * self._robot.world.time_step
        # One that began before is there only if somebody looked.
        if mapper is None or now < self._since:
            return
        began = round((now - start) * self._rate) / self._rate  # without what a sum rounds
        if mapper.take_cloud(began, fields['points']):
            self.clouds, self.mapped_at = self.clouds + 1, now
            for tell in self.on_map:
                tell(mapper.elevation, now)
