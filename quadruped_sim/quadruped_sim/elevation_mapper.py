# SPDX-License-Identifier: Apache-2.0
"""Makes an elevation of what a lidar of points sees, placed by odometry with its drift."""

import numpy as np
from wasd_core.pose_track import PoseTrack
from wasd_core.rotations import matrix_from_quaternion, Pose

from quadruped_sim.elevation import Elevation

# What the data sheet says of a range [m], and how well a trunk's tilt is known [rad].
RANGE_NOISE, TILT_NOISE = 0.02, 0.005
# Farther points tell little of heights [m].
FARTHEST = 3.0
# A cloud takes 67 ms [s].
TRACKED = 0.5
# Two points that a lidar has seen within this time [s], as near to each other [m], are of a wall
# or a riser where the line through them is steeper than 35 degrees and rises by more than noise
# does [m]. Such points are no ground: they would blur the edge above them by their noise.
SOON, NEAR, STEEP, RISES = 2e-4, 0.3, 0.7, 0.02
# How many points later the second of them comes.
_LATER = (1, 2)


class ElevationMapper:
    """
    Maps from clouds and odometry, in simulated time; `elevation` is in odometry's frame.

    Its heights follow odometry: if a whole cloud is above or below the map, as on a slope that
    odometry gets wrong by a few percent, the map moves to the cloud.
    """

    def __init__(self, mount: Pose) -> None:
        """Take where the lidar's frame is in the base."""
        self._mount = mount
        self.elevation = Elevation()
        self.reset()

    def reset(self) -> None:
        """Forget the map and where the robot was."""
        self._track = PoseTrack(TRACKED)
        self._posed_at = self._seen_at = -np.inf
        self.elevation.reset()

    def take_pose(self, time: float, position: np.ndarray, orientation: np.ndarray) -> None:
        """
        Take where odometry has the base at a time [s], as often as it is known.

        `position` is (3,) [m], `orientation` a quaternion w x y z. If time jumps back, the mapper
        resets.
        """
        if time < self._posed_at:
            self.reset()
        self._posed_at = time
        self._track.add(time, position, orientation)

    def take_cloud(self, time: float, points: np.ndarray) -> bool:
        """
        Add a cloud that began at a time [s]; return whether it could be placed.

        `points` have the fields x y z [m], in the lidar's frame, and `time` since then [s].
        """
        seen = np.stack([points[axis] for axis in 'xyz'], axis=1).astype(float)
        times = time + points['time'].astype(float)
        placed, last = self._track.place(seen, times, self._mount), self._track.last
        if placed is None or last is None:
            return False
        position, orientation = last
        if np.isfinite(self._seen_at):
            self.elevation.age(time - self._seen_at)
        self._seen_at = time
        self.elevation.move_to(position[:2])
        rotation = matrix_from_quaternion(orientation)
        lidar = position + rotation @ self._mount.position
        ranges, is_upright = np.linalg.norm(seen, axis=1), _is_upright(placed, times)
        is_near = (ranges > 0.0) & (ranges < FARTHEST)
        used = is_near & ~is_upright
        away, ranges = placed[used] - lidar, ranges[used]
        along = RANGE_NOISE * away[:, 2] / ranges
        tilted = TILT_NOISE * np.hypot(away[:, 0], away[:, 1])
        ground = placed[used]
        self.elevation.lift(self.elevation.offset_of(ground))
        self.elevation.add(ground, along**2 + tilted**2)
        self.elevation.clear(placed[is_near & is_upright], lidar)
        return True


def _is_upright(points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return which points (n, 3) [m], in the order of their times [s], are of upright faces."""
    found = np.zeros(len(points), bool)
    for later in _LATER:
        between = points[later:] - points[:-later]
        level, rise = np.hypot(between[:, 0], between[:, 1]), np.abs(between[:, 2])
        are_together = (times[later:] - times[:-later] < SOON) & (level < NEAR)
        steep = are_together & (rise > RISES) & (rise > STEEP * level)
        found[later:] |= steep
        found[:-later] |= steep
    return found
