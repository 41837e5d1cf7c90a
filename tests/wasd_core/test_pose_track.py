# SPDX-License-Identifier: Apache-2.0
"""What is seen from a base that moves is where it is."""

from cases import for_all
import numpy as np
import pytest
from wasd_core.pose_track import PoseTrack
from wasd_core.rotations import Pose, rpy_matrix, to_quaternion

MOUNT = Pose(np.array((0.3, 0.0, -0.05)), rpy_matrix(0.1, 2.9, -0.2))
POINT = np.array((2.0, -1.0, 0.4))


def base_at(time: float) -> Pose:
    """Return a base that drives on a circle, and nods."""
    yaw = 1.5 * time
    place = np.array((np.sin(yaw), 1.0 - np.cos(yaw), 0.3 + 0.02 * np.sin(9.0 * time)))
    return Pose(place, rpy_matrix(0.02, 0.1 * np.sin(9.0 * time), yaw))


def filled(start: float, end: float) -> PoseTrack:
    track = PoseTrack(0.5)
    for time in np.arange(start, end, 0.002):
        base = base_at(time)
        track.add(time, base.position, np.array(to_quaternion(base.rotation)))
    return track


@for_all('start', [0.0, 1.9])  # at the second the quaternion changes its sign
def test_a_point_that_stands_is_in_one_place_whenever_it_was_seen(start):
    times = start + np.random.default_rng(1).uniform(0.01, 0.4, 50)
    seen = []
    for time in times:
        sensor = base_at(time) @ MOUNT
        seen.append(sensor.rotation.T @ (POINT - sensor.position))
    placed = filled(start, start + 0.45).place(np.array(seen), times, MOUNT)
    assert placed == pytest.approx(np.tile(POINT, (50, 1)), abs=2e-5)


def test_before_the_first_pose_the_base_stood_there_and_after_the_last_it_stands():
    track = filled(0.0, 0.1)
    for time, at in ((-1.0, 0.0), (3.0, 0.098)):
        placed = track.place(np.zeros((1, 3)), np.array((time,)), MOUNT)
        assert placed == pytest.approx((base_at(at) @ MOUNT).position[None], abs=1e-9)


def test_a_track_forgets_and_begins_again_with_time():
    track = filled(0.0, 2.0)
    placed = track.place(np.zeros((1, 3)), np.array((0.0,)), MOUNT)
    assert placed == pytest.approx((base_at(1.498) @ MOUNT).position[None], abs=1e-9)
    track.add(0.1, np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0)))
    (placed,) = track.place(np.zeros((1, 3)), np.array((1.9,)), MOUNT)
    assert placed == pytest.approx(MOUNT.position)
    assert PoseTrack(0.5).place(np.zeros((1, 3)), np.zeros(1), MOUNT) is None
