# SPDX-License-Identifier: Apache-2.0
"""A log of mbot in physics: it follows a way by the truth, and is believed by nobody but it."""

import math

from mujoco_sim.flats import make_flat
from mujoco_sim.sensors import Site
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.table import read_sensor_tags
import numpy as np
from robot_description.description import load_robot
from slam_logs import as_matrix, drive, Log, LOOK_AHEAD, TICK
import wasd
from wasd_navigation.records import read_scan
from wasd_navigation.se2 import wrap


def drive_mbot(seed: int, length: float) -> Log:
    """Return the log of mbot on a way of a length [m] at least through the flat of a seed."""
    way = drive(make_flat(seed), length, seed)[:, :2]
    robot = wasd.Mbot(world=f'flat:{seed}', seed=seed)
    loaded = load_robot('mbot')
    ((tag,), _), _ = read_sensor_tags(loaded.robot)
    lidar, random = Lidar(tag, Site(robot._world, loaded.robot)), np.random.default_rng(seed)
    angles = np.linspace(tag.min_angle, tag.max_angle, tag.samples)
    rows, at, looked = [], 0, -math.inf
    while at < len(way) - 1:
        pose = where(robot)
        if robot.time - looked >= 1.0 / tag.rate - 1e-9:
            looked = robot.time
            scan = read_scan(
                lidar.scan(random), angles, (tag.min_range, tag.max_range), np.zeros(3)
            )
            state = robot.odometry
            known = as_matrix(robot._unit.controller.covariance)
            rows.append((looked, pose, np.array((state.x, state.y, state.yaw)), known, scan))
        while at < len(way) - 1 and math.dist(way[at], pose[:2]) < LOOK_AHEAD:
            at += 1
        ahead = wrap(math.atan2(way[at, 1] - pose[1], way[at, 0] - pose[0]) - pose[2])
        robot.drive(0.5 * max(0.0, 1.0 - abs(ahead) / 0.8), min(1.0, max(-1.0, 2.5 * ahead)))
        robot.run(TICK)
    stamps, truth, odometry, covariances, scans = zip(*rows, strict=True)
    return Log(
        np.array(stamps), np.array(truth), np.array(odometry), np.array(covariances), list(scans)
    )


def where(robot: wasd.Mbot) -> np.ndarray:
    """Return the true pose of the base in the plane, shape (3,)."""
    truth = robot.truth
    return np.array((*truth.position[:2], truth.rpy[2]))
