# SPDX-License-Identifier: Apache-2.0
"""A log of mbot in physics: it follows a way by the truth, and is believed by nobody but it."""

import math

from mujoco_sim.flats import make_flat
from mujoco_sim.sensors.lidar import Lidar, LidarTag
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
import numpy as np
from robot_description.description import load_robot
from slam_logs import as_matrix, drive, Log, LOOK_AHEAD, TICK, Way
import wasd
from wasd_navigation.odometry import moves_between
from wasd_navigation.records import read_scan
from wasd_navigation.se2 import wrap

# Of a tick: physics stops so often for the lidar to look.
SLICES = 4


def drive_mbot(seed: int, length: float) -> Log:
    """Return the log of mbot on a way of a length [m] at least through the flat of a seed."""
    way = drive(make_flat(seed), length, seed)[:, :2]
    robot = wasd.Mbot(world=f'flat:{seed}', seed=seed)
    loaded = load_robot('mbot')
    ((tag,), *_), _ = read_sensor_tags(loaded.robot)
    assert isinstance(tag, LidarTag)
    lidar, random = Lidar(tag, Site(robot._world, loaded.robot)), np.random.default_rng(seed)
    ticks: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
    turns: list[tuple[float, np.ndarray]] = []
    at, begin = 0, -math.inf
    while at < len(way) - 1:
        pose, state = where(robot), robot.odometry
        known = as_matrix(robot._robot.drive_unit.controller.covariance)
        ticks.append((robot.time, pose, np.array((state.x, state.y, state.yaw)), known))
        if robot.time - begin >= 1.0 / tag.rate - 1e-9:
            begin = robot.time
            lidar.begin(0, 0.0)
        while at < len(way) - 1 and math.dist(way[at], pose[:2]) < LOOK_AHEAD:
            at += 1
        ahead = wrap(math.atan2(way[at, 1] - pose[1], way[at, 0] - pose[0]) - pose[2])
        robot.drive(0.5 * max(0.0, 1.0 - abs(ahead) / 0.8), min(1.0, max(-1.0, 2.5 * ahead)))
        for _ in range(SLICES):
            robot.run(TICK / SLICES)
            ranges = lidar.step(TICK / SLICES)
            if ranges is not None:
                turns.append((begin, tag.err(ranges, random)))
    times, truth, odometry, covariances = (np.array(part) for part in zip(*ticks, strict=True))
    way_said = Way(times, odometry)
    rays = tag.time_increment * np.arange(tag.samples)
    scans, rows = [], []
    for begin, ranges in turns:
        row = int(np.argmin(np.abs(times - (begin + 0.5 * rays[-1]))))
        moved = moves_between(odometry[row], way_said.at(begin + rays))
        limits = (tag.min_range, tag.max_range)
        scans.append(read_scan(ranges, tag.angles, limits, moved=moved))
        rows.append(row)
    return Log(times[rows], truth[rows], odometry[rows], covariances[rows], scans)


def where(robot: wasd.Mbot) -> np.ndarray:
    """Return the true pose of the base in the plane, shape (3,)."""
    truth = robot.truth
    return np.array((*truth.position[:2], truth.rpy[2]))
