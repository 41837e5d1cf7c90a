# SPDX-License-Identifier: Apache-2.0
"""A lidar that turns: each ray at its own time; noise by range, lost rays, glass, spokes."""

from dataclasses import replace
import math

from cases import for_all
from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.scene import ROOM_SIZE
from mujoco_sim.sensors.lidar import Lidar, with_model
from mujoco_sim.sensors.lidar_models import LIDAR_MODELS
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot

HALF = 0.5 * ROOM_SIZE
PANE = """
<mujoco><asset><material name="window_glass" rgba="0.8 0.9 1 0.2"/></asset><worldbody>
<geom name="ground" type="plane" size="9 9 1"/>
<geom type="box" size="0.005 2 1" pos="1 0 1" material="window_glass"/>
<geom type="box" size="0.05 4 1" pos="3.05 0 1"/></worldbody></mujoco>
"""
ALL_ROUND = """
<robot name="r"><link name="base"><inertial><mass value="5"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<gazebo reference="base"><sensor type="ray" name="eye"><update_rate>{rate}</update_rate>
<model>a1</model><ray><scan><horizontal><samples>360</samples><min_angle>-3.14159265</min_angle>
<max_angle>3.14159265</max_angle></horizontal></scan></ray></sensor></gazebo></robot>
"""


@pytest.fixture
def tag(loaded):
    ((tag,), *_), _ = read_sensor_tags(loaded.robot)
    return tag


@pytest.fixture
def room(loaded):
    return build_world(loaded, 'room')


def place(world, x, yaw):
    world.data.qpos[:2] = x, 0.0
    world.data.qpos[3:7] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)


def wall_at(x, heading):
    """Return how far the walls of the room are from (x, 0) [m]."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.minimum(
        (np.where(cos > 0.0, HALF, -HALF) - x) / cos, np.where(sin > 0.0, HALF, -HALF) / sin
    )


@pytest.mark.parametrize(('speed', 'rate'), [(0.0, 1.0), (0.5, 0.0), (0.5, -1.5)])
def test_each_ray_begins_where_the_lidar_is_at_its_time(loaded, room, tag, speed, rate):
    lidar, dt, time, ranges = Lidar(tag, Site(room, loaded.robot)), 0.005, 0.0, None
    place(room, 0.0, 0.0)
    lidar.begin(0, 0.0)
    lidar.step(0.0)
    while ranges is None:
        time += dt
        place(room, speed * time, rate * time)
        ranges = lidar.step(dt)
    times = tag.time_increment * np.arange(tag.samples)
    assert times[-1] == pytest.approx(6.0 / (2.0 * math.pi) / 5.5)
    assert time == pytest.approx(times[-1], abs=dt)
    expected = wall_at(speed * times, tag.angles + rate * times)
    # The rest of them ends on what stands in the room, before the walls.
    assert (np.abs(ranges - expected) < 2e-4).mean() > 0.5
    assert (ranges < expected + 2e-4).all()
    if rate:
        stood = wall_at(0.0, tag.angles)
        assert (np.abs(ranges - stood) < 1e-2).mean() < 0.3


def test_a_revolution_begins_where_the_lidar_is_not_where_the_last_one_ended(loaded, room, tag):
    lidar = Lidar(tag, Site(room, loaded.robot))
    for number, x, late in ((0, 0.0, 0.0), (1, 0.5, 0.002)):
        place(room, x, 0.0)
        lidar.begin(number, late)
        ranges = lidar.step(0.0)
        while ranges is None:
            ranges = lidar.step(0.005)
    np.testing.assert_allclose(ranges[:11], wall_at(0.5, tag.angles[:11]), atol=2e-4)


def test_noise_is_a_share_of_the_range_and_some_rays_are_lost(tag):
    one = replace(tag, noise=0.002, noise_share=0.01, dropouts=0.03, resolution=0.0)
    true = np.linspace(0.15, 5.0, one.samples)
    said = np.array([one.err(true, np.random.default_rng((7, k))) for k in range(400)])
    lost = np.isposinf(said)
    # 144 000 draws: the share is known to 0.05 %.
    assert lost.mean() == pytest.approx(0.03, abs=0.002)
    spread = np.array([np.std(said[~lost[:, i], i] - true[i]) for i in range(one.samples)])
    np.testing.assert_allclose(spread, np.maximum(0.002, 0.01 * true), rtol=0.2)
    assert np.mean(spread / np.maximum(0.002, 0.01 * true)) == pytest.approx(1.0, abs=0.01)
    np.testing.assert_array_equal(one.err(true, None), true)


def test_a_spoke_hides_what_is_behind_it(tag):
    one = replace(tag, spokes=((1.0, 0.2), (-math.pi + 0.2, 0.3)))
    said = one.err(np.full(one.samples, 2.0), None)
    hidden = (np.abs(one.angles - 1.0) <= 0.1) | (one.angles <= -math.pi + 0.35)
    np.testing.assert_array_equal(np.isneginf(said), hidden)


@pytest.mark.parametrize('name', LIDAR_MODELS)
def test_a_model_turns_as_its_sheet_says_and_an_ideal_lidar_does_not(tag, name):
    model, one = LIDAR_MODELS[name], with_model(tag, name)
    assert one.turns
    assert one.time_increment * 2.0 * math.pi / one.angle_increment == pytest.approx(
        1.0 / model.rate
    )
    assert (one.min_range, one.max_range) == (model.min_range, model.max_range)
    # As many to a whole turn as its sheet says, between the angles of the tag.
    assert 2.0 * math.pi / one.angle_increment == pytest.approx(model.samples, rel=0.01)
    ideal = with_model(one, 'ideal')
    assert (ideal.turns, ideal.time_increment) == (False, 0.0)
    assert ideal.deviations(np.array((1.0, 5.0))) == pytest.approx((one.noise, one.noise))


def test_a_ray_goes_through_glass_unless_it_meets_it_upright(loaded, tag, tmp_path):
    path = tmp_path / 'pane.xml'
    path.write_text(PANE)
    world = build_world(loaded, str(path))
    ranges = Lidar(replace(tag, max_range=20.0), Site(world, loaded.robot)).true_ranges()
    angles = tag.angles
    for angle, wall in ((0.0, 0.995), (0.1, 0.995), (0.3, 3.0), (-0.8, 3.0)):
        ray = int(np.argmin(np.abs(angles - angle)))
        assert ranges[ray] == pytest.approx(wall / math.cos(angles[ray]), abs=1e-3)


class Turning:
    """Sensors of mbot in a room, and what is heard of its lidar."""

    def __init__(self, loaded, **settings):
        self.world = build_world(loaded, 'room', 3)
        self.sensors = Sensors(loaded, self.world, SimulatorParameters(**settings))
        self.wanted, self.heard = True, []
        (topic,) = (topic for topic in self.sensors.topics if topic.name == 'scan')
        topic.listen(lambda now, said: self.heard.append((now, said)), lambda: self.wanted)

    def run(self, seconds):
        for _ in range(round(seconds / 0.01)):
            self.sensors.step()
            self.world.step(10)


def test_a_scan_has_the_time_of_its_first_ray_and_comes_with_its_last(loaded):
    turning = Turning(loaded)
    turning.run(1.0)
    assert [now for now, _ in turning.heard] == pytest.approx(np.arange(5) / 5.5)
    _, said = turning.heard[0]
    assert said['scan_time'] == pytest.approx(1.0 / 5.5)
    assert said['time_increment'] * 359 == pytest.approx(6.0 / (2.0 * math.pi) / 5.5)
    assert len(said['ranges']) == 360


def test_who_comes_late_gets_whole_revolutions_with_the_same_noise(loaded):
    first, late = Turning(loaded), Turning(loaded)
    late.wanted = False
    for turning in (first, late):
        turning.run(0.5)
        turning.wanted = True
        turning.run(0.45)
    assert [now for now, _ in late.heard] == pytest.approx([3 / 5.5, 4 / 5.5])
    for (_, one), (_, other) in zip(first.heard[3:5], late.heard, strict=True):
        assert one['ranges'] == other['ranges']


def test_after_a_reset_a_lidar_turns_by_the_same_steps_bit_by_bit(loaded, monkeypatch):
    step, steps, episodes = Lidar.step, [], []
    monkeypatch.setattr(Lidar, 'step', lambda lidar, dt: steps.append(dt) or step(lidar, dt))
    turning = Turning(loaded)
    for _ in range(3):
        turning.run(0.4)
        episodes.append(steps[:])
        steps.clear()
        turning.sensors.reset()
    assert len(episodes[0]) == 40
    assert episodes[0] == episodes[1] == episodes[2]


@for_all('rate', ['3.333333', '6.666666', '16.6666666', '7', '4.9999999'])
def test_a_lidar_that_sees_all_round_gives_every_scan_at_any_rate(tmp_path, rate):
    path = tmp_path / 'all_round.urdf'
    path.write_text(ALL_ROUND.format(rate=rate))
    turning = Turning(load_robot(str(path)))
    turning.run(1.0)
    count = math.floor((1.0 - 0.01) * float(rate))
    assert [now for now, _ in turning.heard] == pytest.approx(np.arange(count) / float(rate))


def test_the_simulators_word_goes_before_that_of_the_description(loaded):
    turning = Turning(loaded, lidar='ideal')
    turning.run(0.5)
    assert [now for now, _ in turning.heard] == pytest.approx([0.0, 0.19, 0.37])
    assert turning.heard[0][1]['time_increment'] == 0.0
    turning = Turning(loaded, lidar='lds')
    turning.run(0.5)
    assert [now for now, _ in turning.heard] == pytest.approx([0.0, 0.2])
    assert turning.heard[0][1]['range_max'] == 3.5
