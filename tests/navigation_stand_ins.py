# SPDX-License-Identifier: Apache-2.0
"""What a navigator needs, without mapping and planning: it remembers what it was given."""

import numpy as np
from wasd_core.rotations import Pose
from wasd_navigation.navigator import Navigator
from wasd_navigation.odometry import Odometry
from wasd_navigation.records import Grid, Scan


class StandInLocator:
    """A map of nothing, one metre to the left of where odometry began."""

    def __init__(self):
        self.correction = np.array([0.0, 1.0, 0.0])
        self.covariance = 1e-4 * np.eye(3)
        self.grid = Grid(np.zeros((40, 60), np.int8), 0.05, (-1.0, -1.0))
        self.reset()

    def step(self, scan, odometry, covariance):
        self.steps.append((scan, odometry, covariance))
        self.revision += 1

    def take_leap(self, before, after):
        self.correction = self.correction + before - after

    def reset(self):
        self.steps, self.revision = [], 0


class StandInPilot:
    """Drives straight on for three steps, then does what it is to `end` with."""

    end = ('arrived', '')
    distance_left, time_left, recoveries = 1.5, 3.0, 0
    costmap = None
    local_path = np.empty((0, 2))

    def __init__(self):
        self.reset()

    def reset(self):
        self.steps, self.goals = [], []
        self.cancel()

    def pause(self):
        self.steps.clear()

    def cancel(self):
        self.state, self.reason = 'idle', ''
        self.path = np.empty((0, 2))

    def set_goal(self, goal, may_be_unknown=False):
        self.goals.append(goal)
        self.steps.clear()
        self.state = 'driving'
        self.path = np.array([[0.0, 0.0], goal[:2]])

    def step(self, grid, revision, pose, velocity, scan, dt):
        self.steps.append((pose, scan, revision))
        if len(self.steps) > 3:
            self.state, self.reason = self.end
        return np.array([0.3, 0.0, 0.1])


def odometry(x=0.0, y=0.0, yaw=0.0, vx=0.0):
    """Return odometry of a level robot."""
    level = Pose(np.zeros(3), np.eye(3))
    return Odometry(np.array([x, y, yaw]), np.array([vx, 0.0, 0.0]), np.zeros((3, 3)), level)


def scan(*ends):
    """Return a scan of a lidar in the middle that hit something at each of these points."""
    return Scan(np.zeros(2), np.array(ends or [(1.0, 0.0)]), np.ones(max(len(ends), 1), bool))


def navigator(placed=True):
    """Return a navigator that knows where it is, unless that is not wanted."""
    made = Navigator(StandInLocator(), StandInPilot())
    if placed:
        made.move(odometry())
        made.see(scan(), odometry())
    return made
