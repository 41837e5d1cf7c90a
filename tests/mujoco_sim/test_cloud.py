# SPDX-License-Identifier: Apache-2.0
"""A lidar of points: each ray at its own time, sparse far away, without the robot's own body."""

import math

from cases import for_all
import mujoco
from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.sensors.cloud import CLOUD_MODELS, CloudTag, POINT
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from wasd_core.rotations import Pose

L1 = CLOUD_MODELS['l1']
TAG = CloudTag(
    name='l1',
    link='radar',
    pose=Pose(np.zeros(3), np.eye(3)),
    frame='radar',
    rate=L1.rate,
    topic='points',
    alias='',
    model=L1,
)
# Where Unitree's URDF has it: turned about y by so much [rad], in the base frame [m].
PITCH, PLACE = 2.8782, (0.28945, 0.0, -0.046825)


class Standing:
    """A Go2 that hangs in the air of a world, and its clouds."""

    def __init__(self, world, **settings):
        robot = load_robot('go2')
        self.world = build_world(robot, world)
        self.sensors = Sensors(robot, self.world, SimulatorParameters(**settings))
        self.clouds = []
        self.world.data.qpos[self.world.parts.pose][2] = 0.4
        mujoco.mj_forward(self.world.model, self.world.data)
        self.base = self.world.base()

    def listen(self, topic='points'):
        self.sensors.listen(topic, lambda now, fields: self.clouds.append((now, fields['points'])))

    def run(self, seconds):
        """Let time pass; the robot is held where it is."""
        state = self.world.data.qpos.copy(), self.world.data.qvel.copy()
        for _ in range(round(seconds / (2 * self.world.time_step))):
            self.sensors.step()
            self.world.step(2)
            self.world.data.qpos[:], self.world.data.qvel[:] = state[0], 0.0

    def in_world(self, points):
        """Return points in the world's axes [m], shape (n, 3); the base is level."""
        cos, sin = math.cos(PITCH), math.sin(PITCH)
        turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        places = np.stack((points['x'], points['y'], points['z']), axis=1)
        return places @ turn.T + PLACE + self.base.position


def test_its_rays_are_unit_vectors_of_a_half_sphere_and_none_goes_where_the_last_turn_went():
    times = np.arange(L1.points) / L1.points
    rays = TAG.directions(times)
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0)
    height = np.arcsin(np.clip(rays[:, 2], -1.0, 1.0))
    assert height.min() == pytest.approx(0.0, abs=1e-9)
    assert height.max() == pytest.approx(0.5 * math.pi, abs=1e-3)
    turn = L1.points // L1.turns
    off = np.degrees(np.arccos(np.clip((rays[:turn] * rays[turn : 2 * turn]).sum(1), -1.0, 1.0)))
    assert np.median(off) > 5.0


@for_all('distance', [1.0, 2.0, 5.0, 10.0])
def test_fewer_rays_come_back_from_far_away(distance):
    random = np.random.default_rng(100)
    seen = np.isfinite(TAG.err(np.full(20_000, distance), random)).mean()
    assert seen == pytest.approx(0.95 / (1.0 + (distance / 5.0) ** 2), abs=0.02)


def test_the_error_of_a_range_has_the_deviation_of_its_model_and_no_mean():
    ranges = TAG.err(np.full(100_000, 3.0), np.random.default_rng(101))
    errors = ranges[np.isfinite(ranges)] - 3.0
    assert abs(errors.mean()) < 4.0 * L1.noise / math.sqrt(len(errors))
    assert errors.std() == pytest.approx(L1.noise, rel=0.02)


def test_what_it_sees_of_a_flat_floor_is_on_it_and_nothing_is_of_its_own_body():
    robot = Standing('flat', sensor_noise=False)
    robot.listen()
    robot.run(1.1)
    assert len(robot.clouds) >= 15
    for _, points in robot.clouds:
        places = robot.in_world(points)
        assert np.abs(places[:, 2]).max() < 1e-3
        assert len(places) > 500


def test_each_point_has_its_own_time_and_clouds_follow_each_other():
    robot = Standing('room', sensor_noise=False)
    robot.listen()
    robot.run(2.1)
    begins = [now for now, _ in robot.clouds]
    assert np.allclose(np.diff(begins), 1.0 / L1.rate, atol=1e-9)
    rays = 0
    for _, points in robot.clouds[:15]:
        assert points.dtype == POINT
        times = np.round(points['time'] * L1.points).astype(int)
        assert (np.diff(times) > 0).all()
        assert times[-1] < L1.points / L1.rate
        rays = max(rays, times[-1] + 1)
    assert rays == pytest.approx(L1.points / L1.rate, abs=60)  # the last ones may be of its legs


def test_the_same_seed_gives_the_same_cloud_whoever_listened_before():
    first, again = Standing('room'), Standing('room')
    first.listen()
    first.run(0.5)
    again.run(0.2)
    again.listen()
    again.run(0.3)
    late = dict(again.clouds)
    both = [(points, late[now]) for now, points in first.clouds if now in late]
    assert len(both) >= 2
    for one, other in both:
        assert one.tobytes() == other.tobytes()


def test_while_nobody_listens_no_ray_is_cast(monkeypatch):
    robot = Standing('room')
    monkeypatch.setattr('mujoco.mj_multiRay', lambda *_: pytest.fail('a ray was cast'))
    robot.run(0.3)


def test_an_ideal_one_loses_no_ray_and_has_no_noise():
    robot = Standing('flat', lidar='ideal')
    robot.listen('utlidar/cloud')
    robot.run(0.3)
    for _, points in robot.clouds:
        assert np.abs(robot.in_world(points)[:, 2]).max() < 1e-3
