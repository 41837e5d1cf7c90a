# SPDX-License-Identifier: Apache-2.0
"""
Where the points of a Go2's clouds lie in a room, compared with what stands there.

Simulated: legs, the L1 with its noise, gaps and lost rays, the IMU with its noise; the pose is the
Kalman filter's, with its drift. A point of a walking robot is placed by odometry from where the
base was when it was seen; then the base at the cloud's end is laid on where it truly is.
"""

from typing import Any, NamedTuple

import mujoco
from mujoco_sim.sensors.lidar import SEEN_GROUPS
import numpy as np
import wasd
from wasd_core.pose_track import PoseTrack
from wasd_core.rotations import matrix_from_quaternion

# Ahead [m/s] and in a turn [rad/s], each for so long [s].
WAYS, WAY = ((0.5, 0.5), (0.5, -0.5), (0.0, 1.0)), 4.0
# Points lower than this are the floor's [m].
LOW = 0.12
# Ranges that count for the mean of a wall at 3 m [m]; how long a robot stands before it [s].
WALL, STAND = (2.8, 3.2), 3.0


class Seen(NamedTuple):
    """How far points are from walls and things [m], corrected or not, and errors of ranges [m]."""

    corrected: np.ndarray
    uncorrected: np.ndarray
    at_wall: np.ndarray
    clouds: int


class Onlooker:
    """A Go2 in a room that notes its clouds."""

    def __init__(self, seed: int) -> None:
        self.dog = wasd.Go2('room', seed)
        self.robot: Any = self.dog._robot
        topics = self.robot.sensors.topics
        topic = next(topic for topic in topics if topic.kind == 'PointCloud2')
        self._mount = topic.mount
        self._track = PoseTrack(1.0)
        # Pairs of points (n, 3) in the world [m], corrected and not; errors of ranges.
        self.clouds: list[tuple[np.ndarray, np.ndarray]] = []
        self.ranges: list[np.ndarray] = []
        topic.listen(self._take)
        schedule = self.robot.simulation.schedule
        schedule.every(self.robot.period, self._look)
        self.robot.schedule_sensing(schedule)

    def _look(self) -> None:
        odometry = self.robot.odometry
        if odometry is not None:
            time = self.robot.world.time
            self._track.add(time, odometry.position, odometry.orientation)

    def _take(self, now: float, fields: dict[str, Any]) -> None:
        points = fields['points']
        seen = np.stack([points[axis] for axis in 'xyz'], axis=1).astype(float)
        placed = self._track.place(seen, now + points['time'].astype(float), self._mount.pose)
        if placed is None:
            return
        truth, belief = self.dog.truth, self.dog.odometry
        turn, believed = map(matrix_from_quaternion, (truth.orientation, belief.orientation))
        in_base = seen @ self._mount.pose.rotation.T + self._mount.pose.position
        relative = (placed - belief.position) @ believed
        self.clouds.append((relative @ turn.T + truth.position, in_base @ turn.T + truth.position))
        self.ranges.append(self._range_errors(seen))

    def _range_errors(self, seen: np.ndarray) -> np.ndarray:
        """Return by how much ranges are too long now [m], of what is as far as WALL."""
        world = self.robot.world
        lidar = self._mount.in_world(world.data)
        ranges, hit = np.linalg.norm(seen, axis=1), np.zeros(1, np.int32)
        directions = (seen / ranges[:, None]) @ lidar.rotation.T
        errors = []
        for way, direction in zip(ranges, directions, strict=True):
            true = mujoco.mj_ray(
                world.model,
                world.data,
                lidar.position,
                direction,
                SEEN_GROUPS,
                True,
                self._mount.body,
                hit,
            )
            if WALL[0] < true < WALL[1]:
                errors.append(way - true)
        return np.array(errors)


def look_around(seed: int) -> Seen:
    """Stand before a wall, then trot and turn, and compare."""
    onlooker = Onlooker(seed)
    dog = onlooker.dog
    dog.press('2')
    dog.run(2.5)
    onlooker.ranges.clear()
    dog.run(STAND)
    at_wall = np.concatenate(onlooker.ranges)
    dog.press('5')
    onlooker.clouds.clear()
    for ahead, turn in WAYS:
        dog.drive(ahead, 0.0, turn)
        dog.run(WAY)
    corrected, uncorrected = map(np.concatenate, zip(*onlooker.clouds, strict=True))
    high = corrected[:, 2] > LOW
    world = onlooker.robot.world
    return Seen(
        distances(world, corrected[high]),
        distances(world, uncorrected[high]),
        at_wall,
        len(onlooker.clouds),
    )


def distances(world: Any, points: np.ndarray) -> np.ndarray:
    """Return how far points (n, 3) are from the nearest surface of a thing that stands [m]."""
    model, data = world.model, world.data
    nearest = np.full(len(points), np.inf)
    own = model.body_rootid[world.parts.root]
    for geom in np.flatnonzero(model.body_rootid[model.geom_bodyid] != own):
        inside = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        size, kind = model.geom_size[geom], model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_PLANE:
            off = np.abs(inside[:, 2:])
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            off = np.abs(inside) - size
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            radius = np.hypot(inside[:, 0], inside[:, 1])
            off = np.column_stack((radius - size[0], np.abs(inside[:, 2]) - size[1]))
        else:
            raise ValueError(f'geom {geom} of kind {kind}: wanted planes, boxes and cylinders')
        # Outside it is the way to the surface, inside that to the nearest face.
        outside = np.linalg.norm(np.maximum(off, 0.0), axis=1)
        nearest = np.minimum(nearest, np.abs(outside + np.minimum(off.max(axis=1), 0.0)))
    return nearest
