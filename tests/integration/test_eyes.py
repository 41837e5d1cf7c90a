# SPDX-License-Identifier: Apache-2.0
"""A Go2 that walks by sight, and one whose map knows nothing, which walks as if blind."""

from dataclasses import replace
import math
import re

from descriptions import robot_named
import numpy as np
import pytest
from quadruped_sim.elevation import Elevation
import wasd
from wasd_core.errors import UserError

pytestmark = pytest.mark.long


def stand_up(dog):
    """Stand, ready to drive: that takes a second."""
    dog.press('2')
    dog.press('5')
    dog.run(1.2)


def walk(dog, seconds):
    """Stand, then walk ahead; return where base and joints are twice a second, bit by bit."""
    stand_up(dog)
    dog.drive(0.4, 0.0, 0.1)
    states = []
    for _ in range(round(2.0 * seconds)):
        dog.run(0.5)
        states.append(dog._world.data.qpos.copy())
    return np.array(states)


@pytest.mark.slow
def test_where_the_map_knows_nothing_it_walks_as_if_blind_to_the_last_bit():
    world = 'boxes:0.08'
    blind, seeing = wasd.Go2(world, seed=120), wasd.Go2(world, seed=120, eyes=True)
    empty = Elevation()
    seeing._robot.legs.see(empty)
    assert seeing._robot.legs.controller.locomotion.sight.terrain is empty
    np.testing.assert_array_equal(walk(blind, 1.5), walk(seeing, 1.5))


def climb(world, eyes, seconds):
    """Walk ahead for so long, or 2 m; return where the base is then, and the state."""
    dog = wasd.Go2(world, seed=120, eyes=eyes)
    stand_up(dog)
    dog.drive(0.4)
    end = dog.time + seconds
    while dog.time < end and dog.truth.position[0] < 2.05:
        dog.run(0.1)
    return dog.truth.position, dog.state


@pytest.mark.slow
def test_by_sight_it_climbs_a_step_of_20_cm_that_stops_it_blind():
    position, state = climb('step:0.2', eyes=True, seconds=7.0)
    assert state == 'move base'
    assert position[0] > 2.0
    assert position[2] == pytest.approx(0.5, abs=0.05)
    position, state = climb('step:0.2', eyes=False, seconds=4.5)  # 1.8 m if nothing stops it
    assert position[0] < 1.2 or state != 'move base'


@pytest.mark.slow
def test_it_sees_a_gap_that_is_hardly_wider_than_a_foot_before_it_steps_into_it():
    """It fell, as points of the rims fill a gap of 12 cm and those of its wall are no ground."""
    dog = wasd.Go2('gap:0.12', seed=7003, eyes=True)
    stand_up(dog)
    dog.drive(0.4)
    while dog.truth.position[0] < 2.25 and dog.time < 8.0:
        dog.run(0.2)
        assert dog.state == 'move base'
        assert dog.truth.position[2] > 0.22
    assert dog.truth.position[0] > 2.2


@pytest.mark.slow
def test_up_stairs_over_their_landing_and_down_odometry_is_right_to_one_percent_of_the_way():
    """It lost 65 cm of height on the landing: feet were drawn to the level of the floor."""
    dog = wasd.Go2('stairs:0.15', seed=122, eyes=True)
    stand_up(dog)
    dog.drive(0.4)
    dog.run(0.1)
    begin, way, highest = dog.truth.position - dog.odometry.position, 0.0, 0.0
    while dog.state == 'move base' and dog.truth.position[0] < 8.3 and dog.time < 35.0:
        before = dog.truth.position.copy()
        dog.run(0.1)
        way += math.dist(before, dog.truth.position)
        highest = max(highest, dog.truth.position[2])
        off = dog.truth.position - dog.odometry.position - begin
        assert np.linalg.norm(off) < 0.06
    assert dog.truth.position[0] > 8.2
    assert highest > 6 * 0.15 + 0.2
    assert np.linalg.norm(off) < 0.01 * way


@pytest.mark.slow
def test_the_key_e_opens_and_shuts_its_eyes_and_a_reset_leaves_them():
    dog = wasd.Go2()
    controller = dog._robot.legs.controller
    assert not controller.eyes
    assert dog.press('e') == 'eyes open: it walks by sight'
    assert controller.locomotion.sight.terrain is dog._robot.elevation.mapper.elevation
    dog.reset()
    assert controller.eyes
    assert dog.press('e') == 'eyes shut: it walks blind'
    assert controller.locomotion.sight.terrain is None


@pytest.mark.slow
def test_the_parameter_eyes_follows_the_key_and_the_key_the_parameter():
    legs = wasd.Go2()._robot.legs
    legs.press('e')
    assert legs.settings.eyes
    assert legs.controller.eyes
    legs.tune(replace(legs.settings, eyes=False))
    assert not legs.controller.eyes


@pytest.mark.slow
def test_after_a_reset_it_sees_where_it_is_and_not_where_it_was():
    dog = wasd.Go2('stairs:0.1', seed=121, eyes=True)
    walk(dog, 1.0)
    mapper = dog._robot.elevation.mapper
    assert np.isfinite(mapper.elevation.heights()).any()
    dog.reset()
    assert not np.isfinite(mapper.elevation.heights()).any()
    assert dog._robot.legs.controller.locomotion.sight._state.share[0] == 0.0


@pytest.mark.slow
def test_after_a_reset_it_walks_by_sight_bit_for_bit_as_before():
    dog, walked = wasd.Go2('stairs:0.1', seed=121, eyes=True), []
    for _ in range(2):
        walk(dog, 1.0)
        heights = dog._robot.elevation.mapper.elevation.heights()
        walked.append((heights.tobytes(), *dog.truth.position, *dog.odometry.position))
        dog.reset()
    assert walked[0] == walked[1]


@pytest.mark.slow
def test_a_lidar_on_a_joint_that_is_held_maps_the_stairs_where_they_are(tmp_path):
    whole = robot_named('go2').urdf
    inertia = 'ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"'
    mass = f'<inertial><mass value="0.2"/><inertia {inertia}/></inertial>'
    turns = '<axis xyz="0 1 0"/><limit lower="-0.5" upper="0.5" effort="2" velocity="2"/>'
    for fixed, held in (
        ('<link name="radar"/>', f'<link name="radar">{mass}</link>'),
        ('name="radar_joint" type="fixed">', f'name="radar_joint" type="revolute">{turns}'),
        # In the head it would see the head: that is another body now.
        ('xyz="0.28945 0 -0.046825"', 'xyz="0.40 0 0.0"'),
    ):
        assert fixed in whole
        whole = whole.replace(fixed, held)
    file = tmp_path / 'neck.urdf'
    file.write_text(whole)
    dog = wasd.Go2('stairs:0.15', description=str(file), eyes=True)
    dog.press('2')
    dog.run(3.0)
    x, y = np.meshgrid(np.arange(0.5, 1.0, 0.02), np.linspace(-0.3, 0.3, 9))
    heights = np.nanmedian(dog._robot.elevation.mapper.elevation.at(x, y), axis=0)
    first = x[0, np.nanargmax(heights > 0.075)]
    off = dog.truth.position - dog.odometry.position
    assert first + off[0] == pytest.approx(0.8, abs=0.04)


@pytest.fixture
def blind(tmp_path):
    """The file of a Go2 without a lidar of points."""
    whole = robot_named('go2').urdf
    tags = re.findall(r'<gazebo reference="[^"]*">.*?</gazebo>', whole, flags=re.DOTALL)
    (lidar,) = [tag for tag in tags if '<topicName>points<' in tag]
    blind = tmp_path / 'blind.urdf'
    blind.write_text(whole.replace(lidar, ''))
    return blind


@pytest.mark.slow
def test_a_robot_without_a_lidar_of_points_says_so(blind):
    with pytest.raises(UserError, match='--eyes: go2.* has no lidar of points: give its desc'):
        wasd.Go2(description=str(blind), eyes=True)
    dog = wasd.Go2(description=str(blind))
    assert dog.press('e') == 'by sight, once there is a lidar of points: blind until then'


@pytest.mark.slow
def test_a_robot_that_is_given_the_lidar_of_points_that_it_lacks_walks_by_sight(blind):
    with pytest.raises(UserError) as error:
        wasd.Go2(description=str(blind), eyes=True)
    named = ''.join(re.findall('<.*>', str(error.value))).replace('LINK', 'base')
    names = re.findall('<([a-z]+)', named)
    closed = named + ''.join(f'</{name}>' for name in reversed(names) if f'</{name}>' not in named)
    blind.write_text(blind.read_text().replace('</robot>', f'{closed}</robot>'))
    wasd.Go2(description=str(blind), eyes=True)
