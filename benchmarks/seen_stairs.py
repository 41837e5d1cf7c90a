# SPDX-License-Identifier: Apache-2.0
"""
What a Go2 knows of stairs after 3 m of walking, compared with the stairs.

Simulated: legs, the L1 with its noise, gaps and lost rays, the IMU with its noise; the pose is the
Kalman filter's, with its drift. Known: where the lidar is mounted, and its noise by its sheet.
Map and world are compared as seen from the robot in the end: where odometry believes the base
to be (x, y, z, yaw) is laid on where it is, for nobody tells feet where the world's origin is.
"""

from typing import Any, NamedTuple

from mujoco_sim.scene import AHEAD, STEPS, TREAD
from mujoco_sim.sensors.heights import true_heights
import numpy as np
from quadruped_sim.elevation_mapper import ElevationMapper
import wasd
from wasd_core.rotations import matrix_from_quaternion, rpy_from_matrix, yaw_matrix

WALK, SPEED = 3.0, 0.4
# Cells nearer to an edge are judged by the edge's place, not by their height [m].
BESIDE = 0.04
# Rows of cells that are looked at for edges, to either side; how far ahead and behind [m].
ASIDE, AHEAD_SEEN, BEHIND_SEEN = 0.5, 0.6, 0.3
# An edge of a row is looked for so far before and behind where it is [m].
LOOKED = 0.14
# An edge counts where so many rows know both treads.
FEWEST = 8
EDGES = AHEAD + TREAD * np.arange(STEPS)


class Seen(NamedTuple):
    """
    What a map says of stairs.

    `edges` has for each that counts its place [m] and the errors of its rows, `rmse` the error
    of known heights away from edges, `rmse_everywhere` of all [m]; `known` is the share of cells.
    """

    edges: dict[float, np.ndarray]
    rmse: float
    rmse_everywhere: float
    known: float
    state: str


class Watcher:
    """A Go2 that maps heights from a moment on."""

    def __init__(self, world: str, seed: int) -> None:
        self.dog = wasd.Go2(world=world, seed=seed)
        self.robot: Any = self.dog._robot
        topics = self.robot.sensors.topics
        topic = next(topic for topic in topics if topic.kind == 'PointCloud2')
        self.mapper = ElevationMapper(topic.mount.pose)
        self.maps = False
        topic.listen(
            lambda now, fields: self.mapper.take_cloud(now, fields['points']),
            lambda: self.maps,
        )
        schedule = self.robot.simulation.schedule
        schedule.every(self.robot.period, self._look)
        self.robot.schedule_sensing(schedule)

    def walk(self, speed: float, until: float) -> None:
        """Walk along x [m/s] to where the base's x is so [m], or for 30 s."""
        end = self.dog.time + 30.0
        sign = np.sign(speed)
        while sign * (until - self.dog.truth.position[0]) > 0.0 and self.dog.time < end:
            self.dog.drive(speed)
            self.dog.run(0.1)

    def _look(self) -> None:
        odometry = self.robot.odometry
        if self.maps and odometry is not None:
            self.mapper.take_pose(self.robot.world.time, odometry.position, odometry.orientation)


def look_at_stairs(rise: float, seed: int, end: float) -> Seen:
    """Walk WALK [m] to where the base's x is `end` [m], of stairs of a rise [m], and compare."""
    watcher = Watcher(f'stairs:{rise:g}', seed)
    dog = watcher.dog
    dog.press('2')
    dog.run(2.5)
    dog.press('5')
    watcher.walk(-SPEED, end - WALK)
    dog.drive(0.0)
    dog.run(1.0)
    watcher.maps = True
    watcher.walk(SPEED, end)
    return compare(watcher)


def compare(watcher: Watcher) -> Seen:
    """Compare a watcher's map with its world."""
    elevation, dog = watcher.mapper.elevation, watcher.dog
    truth, belief = dog.truth, dog.odometry
    along = (np.arange(elevation.count) + 0.5) * elevation.resolution
    places = np.stack(np.meshgrid(*(elevation.corner[:, None] + along)), axis=-1)
    yaws = [
        rpy_from_matrix(matrix_from_quaternion(pose.orientation))[2] for pose in (truth, belief)
    ]
    turn = yaw_matrix(yaws[0] - yaws[1])[:2, :2]
    x, y = np.moveaxis((places - belief.position[:2]) @ turn.T + truth.position[:2], -1, 0)
    z = elevation.heights() - belief.position[2] + truth.position[2]
    off = z - true_heights(watcher.robot.world, x, y)
    known = np.isfinite(off)
    away = known & (np.abs(x[..., None] - EDGES).min(axis=-1) > BESIDE)
    near = np.abs(y - truth.position[1]) < ASIDE
    rise = float(true_heights(watcher.robot.world, np.array([EDGES[0] + 0.1]), np.zeros(1))[0])
    edges = {}
    for step, edge in enumerate(EDGES):
        if -BEHIND_SEEN < edge - truth.position[0] < AHEAD_SEEN:
            rows = [
                _edge_in(row, x, z, known & near, edge, (step + 0.5) * rise)
                for row in range(len(x))
            ]
            errors = np.array([found - edge for found in rows if found is not None])
            if len(errors) >= FEWEST:
                edges[float(edge)] = errors
    return Seen(
        edges,
        float(np.sqrt(np.mean(off[away] ** 2))),
        float(np.sqrt(np.mean(off[known] ** 2))),
        float(known.mean()),
        dog.state,
    )


def _edge_in(
    row: int, x: np.ndarray, z: np.ndarray, known: np.ndarray, edge: float, middle: float
) -> float | None:
    """Return where a row of cells rises above the middle of a step; None where it cannot say."""
    used = known[row] & (np.abs(x[row] - edge) < LOOKED)
    places, heights = x[row, used], z[row, used]
    above = np.flatnonzero(heights > middle)
    if not len(above) or above[0] == 0:
        return None
    return float(0.5 * (places[above[0]] + places[above[0] - 1]))
