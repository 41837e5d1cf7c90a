# SPDX-License-Identifier: Apache-2.0
"""The anchor of mapping: Karto's matcher, slam_toolbox's ancestor, by yag-slam."""

import math
from typing import Any

import numpy as np
from slam_errors import trajectory_error
from slam_logs import Log, MBOT_LIDAR
from wasd_navigation.se2 import compose, inverse

WHY_NOT = 'Karto: not here (extra `anchors`)'
# What slam_toolbox calls minimum_travel_distance and minimum_travel_heading [m], [rad].
TRAVEL, HEADING = 0.2, 0.2


def map_by_karto(log: Log) -> float | None:
    """Return Karto's error on a log of mbot's lidar [m]; None where it is not there."""
    try:
        from yag_slam.graph_slam import GraphSlam
        from yag_slam.helpers import default_config, default_config_loop
        from yag_slam.scan_matching import Scan2DMatcherCpp
    except ImportError:
        return None

    slam = GraphSlam(
        Scan2DMatcherCpp(default_config), Scan2DMatcherCpp(default_config_loop, loop=True)
    )
    taken: list[Any] = []
    placed: list[tuple[int, np.ndarray]] = []
    last: np.ndarray | None = None
    for row, pose in enumerate(log.odometry):
        move = None if last is None else compose(inverse(last), pose)
        if move is None or math.hypot(move[0], move[1]) > TRAVEL or abs(move[2]) > HEADING:
            taken.append(_to_karto(log, row))
            slam.process_scan(taken[-1])
            last, move = pose, np.zeros(3)
        placed.append((len(taken) - 1, move))
    found = []
    for scan in taken:
        corrected = scan.corrected_pose
        found.append(np.array((corrected.x, corrected.y, corrected.euler[-1])))
    return trajectory_error(np.array([compose(found[at], move) for at, move in placed]), log.truth)


def _to_karto(log: Log, row: int) -> Any:
    """Return a scan of a log as Karto has it; rays that hit nothing are longer than it takes."""
    from yag_slam.models import LocalizedRangeScan

    lidar, scan = MBOT_LIDAR, log.scans[row]
    angles = np.arctan2(scan.ends[:, 1], scan.ends[:, 0])
    rays = np.round((angles - lidar.min_angle) / lidar.angle_increment).astype(int)
    rays = np.clip(rays, 0, lidar.samples - 1)
    ranges = np.full(lidar.samples, 2.0 * lidar.max_range)
    ranges[rays[scan.hits]] = np.hypot(*scan.points.T)
    limits = (lidar.min_range, lidar.max_range, lidar.max_range)
    angles = (lidar.min_angle, lidar.max_angle, lidar.angle_increment)
    return LocalizedRangeScan(ranges, *angles, *limits, *log.odometry[row].tolist())
