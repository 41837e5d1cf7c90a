# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math
import xml.etree.ElementTree as ElementTree

from descriptions import robot_named
from mujoco_sim.flats import make_flat
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.scene import ROOM_SIZE
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from robot_description.mujoco.geoms import VISUAL_GROUP
import wasd
from wasd_core.rotations import matrix_from_quaternion

# From its joint in the course's URDF: on the axis of the robot, above its lid.


@pytest.fixture
def room(loaded):
    return build_world(loaded, 'room')


@pytest.fixture
def make(loaded):
    """Return a function that puts mbot's lidar, changed as wanted, into a world."""

    def make(world, robot=loaded, **changes):
        ((tag,), *_), _ = read_sensor_tags(robot.robot)
        return Lidar(replace(tag, **changes), Site(world, robot.robot))

    return make


def place(world, x, y, yaw):
    world.data.qpos[:2] = x, y
    world.data.qpos[3:7] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)


def ray_at(lidar, angle):
    return round((angle - lidar.tag.min_angle) / lidar.tag.angle_increment)


@pytest.mark.parametrize('yaw', [0.0, 0.4, -0.7])
def test_the_walls_of_the_room_are_where_they_are(room, make, yaw):
    place(room, 0.5, -0.3, yaw)
    lidar = make(room)
    ranges = lidar.scan(None)
    half = ROOM_SIZE / 2.0
    for heading, wall in (
        (0.0, half - 0.5),
        (math.pi / 2, half + 0.3),
        (-math.pi / 2, half - 0.3),
    ):
        ray = ray_at(lidar, heading - yaw)
        angle = lidar.tag.min_angle + ray * lidar.tag.angle_increment - (heading - yaw)
        assert ranges[ray] == pytest.approx(wall / math.cos(angle), abs=0.006)


def test_every_ray_hits_the_rectangle_of_the_walls_or_something_before_it(room, make):
    lidar = make(room, resolution=0.0)
    angles = np.linspace(-3.0, 3.0, 360)
    walls = 0.5 * ROOM_SIZE / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    ranges = lidar.true_ranges()
    assert (ranges <= walls + 1e-4).all()
    on_the_wall = np.abs(ranges - walls) < 1e-4
    assert 0.5 < on_the_wall.mean() < 0.9  # the rest are the crate, the shelf, the pillar, the bin


def test_the_same_is_seen_when_the_robot_is_there_to_be_looked_at(loaded, make):
    bare, drawn = (build_world(loaded, 'room', visuals=visuals) for visuals in (False, True))
    np.testing.assert_array_equal(make(bare).true_ranges(), make(drawn).true_ranges())


def test_it_does_not_see_itself(world, make):
    assert np.isinf(make(world).true_ranges()).all()


def test_beyond_and_below_its_range_it_says_so(room, make):
    lidar = make(room)
    ray = ray_at(lidar, 0.0)
    assert np.isposinf(make(room, max_range=2.9).scan(None)[ray])
    place(room, 2.95, 0.0, 0.0)
    assert np.isneginf(lidar.scan(None)[ray])


def test_noise_has_its_spread_and_no_bias(room, make):
    lidar = make(room, noise_share=0.0, dropouts=0.0)
    true = lidar.true_ranges()
    scans = [lidar.scan(np.random.default_rng([7, count])) for count in range(100)]
    errors = np.array(scans) - true
    # 36 000 draws: the mean is known to 0.05 mm; rounding to 1 cm adds 2.9 mm in quadrature.
    assert abs(errors.mean()) < 0.0003
    assert errors.std() == pytest.approx(math.hypot(0.01, 0.01 / math.sqrt(12.0)), rel=0.02)
    np.testing.assert_allclose(np.array(scans) / 0.01, np.round(np.array(scans) / 0.01), atol=1e-6)


def test_measuring_leaves_physics_as_it_is(loaded, make):
    watched, alone = (build_world(loaded, 'room') for _ in range(2))
    lidar = make(watched)
    for world in (watched, alone):
        world.push([5.0, 3.0, 0.0], 0.1)
    for _ in range(100):
        lidar.true_ranges()
        watched.step(2)
        alone.step(2)
    np.testing.assert_array_equal(watched.data.qpos, alone.data.qpos)
    np.testing.assert_array_equal(watched.data.qvel, alone.data.qvel)


HEAD = """
<robot name="pan"><link name="base"><inertial><mass value="1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="pan_joint" type="revolute"><parent link="base"/><child link="head"/>
<origin xyz="0 0 0.2"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint>
<link name="head"><inertial><mass value="0.1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="eye_joint" type="fixed"><parent link="head"/><child link="eye"/>
<origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/></joint><link name="eye"/>
<gazebo reference="eye"><sensor type="ray" name="eye"><ray><scan><horizontal><samples>1</samples>
<min_angle>0</min_angle><max_angle>0</max_angle></horizontal></scan></ray></sensor></gazebo></robot>
"""


@pytest.mark.slow
def test_a_lidar_on_a_head_that_turns_turns_with_it(tmp_path, make):
    path = tmp_path / 'pan.urdf'
    path.write_text(HEAD)
    robot = load_robot(str(path))
    world = build_world(robot, 'room')
    lidar = make(world, robot, samples=1, min_angle=0.0, max_angle=0.0)
    # The eye looks to the left of the head, 10 cm before its axis.
    assert lidar.true_ranges()[0] == pytest.approx(3.0, abs=1e-6)
    world.data.joint('pan_joint').qpos[0] = -math.pi / 2
    assert lidar.true_ranges()[0] == pytest.approx(3.0, abs=1e-6)
    world.data.joint('pan_joint').qpos[0] = math.pi / 2
    assert lidar.true_ranges()[0] == pytest.approx(3.0, abs=1e-6)
    world.data.joint('pan_joint').qpos[0] = math.pi / 4
    # From (0.1, 0.1) / sqrt(2), at 135 degrees to the wall at y = 3 or x = -3.
    reach = (3.0 - 0.1 / math.sqrt(2.0)) * math.sqrt(2.0)
    assert lidar.true_ranges()[0] == pytest.approx(reach, abs=1e-6)


def test_a_link_whose_visual_mesh_is_missing_is_seen_also_where_it_is_drawn(tmp_path, make):
    mast = (
        '<link name="mast"><visual><geometry><mesh filename="package://none/mast.stl"/></geometry>'
        '</visual><collision><geometry><box size="0.4 0.1 0.4"/></geometry></collision></link>'
        '<joint name="mast_joint" type="fixed"><parent link="base"/><child link="mast"/>'
        '<origin xyz="0 1 0.2"/></joint></robot>'
    )
    path = tmp_path / 'pan.urdf'
    path.write_text(HEAD.replace('</robot>', mast))
    robot = load_robot(str(path))
    for visuals in (False, True):
        world = build_world(robot, 'room', visuals=visuals)
        lidar = make(world, robot, samples=1, min_angle=0.0, max_angle=0.0)
        assert lidar.true_ranges()[0] == pytest.approx(0.95)
        assert (world.model.geom_group == VISUAL_GROUP).sum() == visuals


@pytest.fixture(scope='module')
def go2():
    return robot_named('go2')


@pytest.mark.slow
def test_the_go2_walks_on_its_lidar_or_not_the_same(go2):
    # Nor does it weigh anything, for who plans with the description.
    urdf = ElementTree.fromstring(go2.urdf)
    for tag in [*urdf]:
        if 'laser' in str(sorted(tag.attrib.values())):
            urdf.remove(tag)
    without = load_robot('go2', urdf=ElementTree.tostring(urdf, encoding='unicode'))
    assert 'laser_link' not in without.robot.links
    assert go2.robot.mass == without.robot.mass
    worlds = [build_world(robot, 'room', setup=usual_setup(robot)) for robot in (go2, without)]
    for world in worlds:
        world.push((10.0, 20.0, 30.0), 0.1)
        world.step(200)
    np.testing.assert_array_equal(worlds[0].data.qpos, worlds[1].data.qpos)
    for one, other in zip(*(world.read().imu for world in worlds), strict=True):
        np.testing.assert_array_equal(one, other)


def stand(world, pitch=0.0):
    """Put a Go2 on its feet where it is, tilted by a pitch [rad]."""
    world.data.qpos[2] = 0.30
    world.data.qpos[3:7] = math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0
    for leg in ('FL', 'FR', 'RL', 'RR'):
        for part, angle in (('hip', 0.0), ('thigh', 0.8), ('calf', -1.5)):
            world.data.joint(f'{leg}_{part}_joint').qpos[0] = angle


@pytest.mark.slow
@pytest.mark.parametrize('is_lying', [False, True])
def test_a_go2_sees_the_walls_all_around_and_none_of_its_legs(go2, make, is_lying):
    world = build_world(go2, 'flat:3', setup=usual_setup(go2))
    if not is_lying:
        stand(world)
    ranges = make(world, go2).true_ranges()
    flat = make_flat(3)
    assert (ranges > 0.6).all()
    assert (ranges < np.linalg.norm(flat.size)).all()


def test_a_go2_that_stoops_sees_the_floor_where_its_rays_meet_it(go2, make):
    world = build_world(go2, 'flat', setup=usual_setup(go2))
    lidar = make(world, go2)
    assert np.isinf(lidar.true_ranges()).all()
    pitch = math.radians(5.0)
    stand(world, pitch)
    ahead = lidar.true_ranges()[ray_at(lidar, 0.0)]
    height = 0.30 + 0.11 * math.cos(pitch)
    assert ahead == pytest.approx(height / math.sin(pitch), abs=1e-3)


@pytest.mark.slow
def test_on_a_trotting_go2_it_sees_the_walls_as_a_level_one_would(make):
    robot = wasd.Go2(world='flat:3')
    lidar = make(robot._world, robot._robot.description)
    robot.press('2')
    robot.run(3.0)
    robot.press('5')
    robot.drive(0.3, 0.0, 0.4)
    for _ in range(8):
        robot.run(0.25)
        rotation = matrix_from_quaternion(robot.truth.orientation)
        assert math.acos(rotation[2, 2]) < math.radians(1.5)
        ranges = lidar.true_ranges()
        # Nothing ends on the floor, and no wall is looked over.
        heights = robot.truth.position[2] + (lidar._directions.T * ranges[:, None] @ rotation.T)
        assert (heights[:, 2] > 0.1).all()
        assert np.isfinite(ranges).all()
