# SPDX-License-Identifier: Apache-2.0
import os
import struct

from cases import for_all
import mujoco
from mujoco_sim.parameters import BoxSize
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.scene import ROOM_SIZE, WALL_HEIGHT
from mujoco_sim.world import build_shared_world, build_world
import numpy as np
import pytest
from wasd_core.errors import SimulationError
from wasd_core.robot_io import JointCommand

MJCF = (
    '<mujoco><worldbody><geom name="ground" type="plane" size="9 9 1"/>'
    '<geom name="crate" type="box" size=".1 .2 .3" pos="2 0 .3"/></worldbody></mujoco>'
)


@pytest.mark.parametrize('name', ['flat', 'room'])
def test_the_floor_is_at_zero_and_physics_steps_by_a_millisecond(loaded, name):
    model = build_world(loaded, name).model
    floor = model.geom('floor')
    assert floor.type[0] == mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_array_equal(floor.pos, np.zeros(3))
    assert model.opt.timestep == 0.001


def test_a_world_asks_the_page_for_no_ambient_occlusion(loaded, tmp_path):
    path = tmp_path / 'world.xml'
    own = '<custom><numeric name="filament.ao.enabled" data="1"/></custom>'
    path.write_text(MJCF.replace('<worldbody>', f'{own}<worldbody>'))
    for world in ('flat', str(path)):
        model = build_world(loaded, world).model
        assert model.numeric('filament.ao.enabled').data[0] == 0.0


def test_the_sun_goes_along_so_that_the_robot_keeps_its_shadow(loaded):
    world = build_world(loaded)
    sun = world.model.light('sun').id
    before = world.data.light_xpos[sun].copy()
    world.data.qpos[:2] += (30.0, -20.0)
    world.data.qpos[3:7] = (0.0, 0.0, 0.0, 1.0)
    mujoco.mj_forward(world.model, world.data)
    moved = world.data.light_xpos[sun] - before
    np.testing.assert_allclose(moved, (30.0, -20.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(world.data.light_xdir[sun], world.model.light_dir0[sun])


def test_a_room_has_a_wall_on_each_side(loaded):
    world = build_world(loaded, 'room')
    hit = np.zeros(1, dtype=np.int32)
    for direction, wall in (
        ((1, 0, 0), 'east_wall'),
        ((-1, 0, 0), 'west_wall'),
        ((0, 1, 0), 'north_wall'),
        ((0, -1, 0), 'south_wall'),
    ):
        distance = mujoco.mj_ray(
            world.model,
            world.data,
            np.array([0.0, 0.0, 0.5 * WALL_HEIGHT + 0.1]),
            np.array(direction, dtype=float),
            None,
            1,
            world.root,
            hit,
        )
        assert world.model.geom(hit[0]).name == wall
        assert distance == pytest.approx(ROOM_SIZE / 2.0)


@pytest.mark.slow
def test_a_wall_stops_the_robot(loaded):
    world = build_world(loaded, 'room')
    world.data.qpos[0] = ROOM_SIZE / 2.0 - 0.3
    zeros = np.zeros(2)
    world.apply(JointCommand(zeros, np.full(2, 10.0), zeros, zeros, np.full(2, 0.3)))
    world.step(1500)
    # The drum's radius is 0.2 m.
    assert world.base().position[0] < ROOM_SIZE / 2.0 - 0.19


def test_a_model_file_is_put_around_the_robot(loaded, tmp_path):
    path = tmp_path / 'hall.xml'
    path.write_text(MJCF)
    world = build_world(loaded, str(path))
    np.testing.assert_allclose(world.model.geom('world/crate').pos, [2.0, 0.0, 0.3])
    world.step(300)
    np.testing.assert_allclose(world.base().position, np.zeros(3), atol=5e-5)


def test_what_a_model_file_moves_is_no_part_of_the_robot(loaded, tmp_path):
    path = tmp_path / 'hall.xml'
    door = '<body name="door" pos="3 0 1"><joint name="hinge"/><geom size="0.1"/></body>'
    motors = '<motor name="opener" joint="hinge"/><motor joint="hinge"/>'
    path.write_text(
        MJCF.replace('</worldbody>', f'{door}</worldbody><actuator>{motors}</actuator>')
    )
    world, alone = build_world(loaded, str(path)), build_world(loaded)
    assert world.model.nu == alone.model.nu + 2
    assert (world.joint_names, world.motor_names) == (alone.joint_names, alone.motor_names)
    world.step(10)


def test_what_is_free_in_a_model_file_falls_and_a_reset_puts_it_back(loaded, tmp_path):
    path = tmp_path / 'hall.xml'
    ball = '<body name="ball" pos="3 0 1"><freejoint/><geom size="0.1"/></body>'
    gate = '<body name="gate" mocap="true" pos="3 2 0"><geom size="0.1"/></body>'
    path.write_text(MJCF.replace('</worldbody>', f'{ball}{gate}</worldbody>'))
    world, alone = build_world(loaded, str(path), boxes=[BoxSize()]), build_world(loaded)
    assert (world.joint_names, world.motor_names) == (alone.joint_names, alone.motor_names)
    assert world.physics.boxes.put(0, 5.0, 0.0)
    assert world.model.body('world/gate').mocapid[0] >= 0
    height = world.data.body('world/ball').xpos
    world.step(100)
    assert height[2] == pytest.approx(1.0 - 0.5 * 9.81 * 0.1**2, rel=0.01)
    np.testing.assert_allclose(world.base().position, alone.base().position, atol=5e-5)
    world.reset()
    assert height[2] == 1.0


@pytest.mark.filterwarnings('error')
def test_options_of_a_model_file_that_do_not_count_are_told_once(loaded, tmp_path, capfd):
    path = tmp_path / 'hall.xml'
    path.write_text(MJCF.replace('<worldbody>', '<option timestep="0.1"/><worldbody>'))
    assert build_world(loaded, str(path)).model.opt.timestep == 0.001
    assert capfd.readouterr().err.count('Attach conflict') == 1


CLOTH = '<flexcomp name="c" type="grid" count="4 4 1" spacing=".2 .2 .2" radius=".01" dim="2"/>'


@pytest.mark.filterwarnings('error')
def test_what_mujoco_thinks_of_a_model_file_is_said_once_in_a_line(loaded, tmp_path, caplog):
    path = tmp_path / 'hall.xml'
    odd = f'<compiler settotalmass="100"/><worldbody>{CLOTH}'
    path.write_text(MJCF.replace('<worldbody>', odd))
    build_world(loaded, str(path))
    cloth, mass = sorted(caplog.messages, reverse=True)
    assert cloth.startswith(f"{path}: flex 'c' is not rigid")
    assert mass.startswith(f"{path}: compiler attribute 'settotalmass' is deprecated")
    assert '\n' not in cloth


def test_what_a_model_file_lacks_is_said_with_its_name(loaded, tmp_path):
    path = tmp_path / 'hall.xml'
    path.write_text('<mujoco><asset><mesh name="a" file="nowhere.stl"/></asset></mujoco>')
    with pytest.raises(SimulationError, match=f'^{path}: .*nowhere.stl'):
        build_world(loaded, str(path))


def test_an_unknown_world_lists_the_known_ones(loaded):
    with pytest.raises(SimulationError, match='moon: no such file, .*worlds: flat, room'):
        build_world(loaded, 'moon')


def test_a_file_that_is_no_model_is_one_line(loaded, tmp_path):
    path = tmp_path / 'hall.xml'
    path.write_text('<mujoco><nonsense/></mujoco>')
    with pytest.raises(SimulationError, match=f'^{path}: ') as caught:
        build_world(loaded, str(path))
    assert '\n' not in str(caught.value)


@for_all(
    ('body', 'why'),
    [
        (3000 * '<body>' + 3000 * '</body>', 'hall.xml: is nested too deep'),
        ('<include file="pipe.xml"/>', 'pipe.xml: is no file'),
        ('<include file="/dev/zero"/>', '/dev/zero: is no file'),
        ('</worldbody><asset><mesh file="pipe.xml"/></asset><worldbody>', 'pipe.xml: is no file'),
        (
            '</worldbody><compiler meshdir="parts"/><asset><mesh file="../pipe.xml"/></asset>'
            '<worldbody>',
            'pipe.xml: is no file',
        ),
        ('<flexcomp name="cloth" type="mesh" file="pipe.xml"/>', 'pipe.xml: is no file'),
        ('</worldbody><asset><model file="pipe.xml"/></asset><worldbody>', 'xml: is no file'),
        (
            '</worldbody><asset><hfield nrow="60000" ncol="60000"/></asset><worldbody>',
            'hfield: got 60000 x 60000, wanted at most 50000000 cells',
        ),
        (
            '</worldbody><asset><hfield file="large.png" size="1 1 1 1"/></asset><worldbody>',
            'large.png: got 60000 x 60000, wanted at most 50000000 cells',
        ),
        (
            '</worldbody><asset><texture type="cube" fileup="large.png"/></asset><worldbody>',
            'large.png: got 60000 x 60000, wanted at most 50000000 cells',
        ),
        (f'<!--{21_000_000 * " "}-->', 'hall.xml: got 21 MB, wanted at most 20 MB'),
    ],
)
def test_a_world_that_mujoco_would_never_have_read_is_refused(loaded, tmp_path, body, why):
    os.mkfifo(tmp_path / 'pipe.xml')
    head = b'\x89PNG\r\n\x1a\n' + struct.pack('>I4sII', 13, b'IHDR', 60000, 60000)
    (tmp_path / 'large.png').write_bytes(head)
    (tmp_path / 'parts').mkdir()
    path = tmp_path / 'hall.xml'
    path.write_text(f'<mujoco><worldbody>{body}</worldbody></mujoco>')
    with pytest.raises(SimulationError, match=f'{why}$'):
        build_world(loaded, str(path))


REPLICATED = '<replicate count="1000" offset="1 0 0">'


@pytest.mark.parametrize(
    'part', ['', '<include file="part.xml"/>', '<asset><model file="part.xml"/></asset>']
)
def test_a_world_that_makes_endless_copies_is_refused_at_once(loaded, tmp_path, part):
    body = f'{3 * REPLICATED}<geom size="0.1"/>{3 * "</replicate>"}'
    if part:
        (tmp_path / 'part.xml').write_text(f'<mujoco><worldbody>{body}</worldbody></mujoco>')
        body = ''
    world = tmp_path / 'world.xml'
    world.write_text(f'<mujoco>{part}<worldbody>{body}</worldbody></mujoco>')
    with pytest.raises(SimulationError, match='at most 100000 elements and copies, got 100000000'):
        build_world(loaded, str(world))


@for_all(
    ('geom', 'asset', 'name'),
    [
        ('type="box" size="1 1 1" pos="inf 0 0"', '', 'geom_pos'),
        ('size="1"/><light range="nan"', '', 'light_range'),
        (
            'type="hfield" hfield="hills"',
            '<hfield name="hills" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 nan 0"/>',
            'hfield_data',
        ),
    ],
)
def test_a_world_of_numbers_that_are_none_is_refused(loaded, tmp_path, geom, asset, name):
    path = tmp_path / 'hall.xml'
    body = f'<asset>{asset}</asset><worldbody><geom {geom}/></worldbody>'
    path.write_text(f'<mujoco>{body}</mujoco>')
    with pytest.raises(SimulationError, match=f'^{path}: got NaN or infinity for {name}$'):
        build_world(loaded, str(path))


@for_all(
    ('joint', 'more'),
    [
        ('range="-inf inf"', ''),
        ('limited="true" range="-1 inf" actuatorfrcrange="-inf inf"', ''),
        ('', '<actuator><motor joint="j" ctrlrange="-inf inf" forcerange="-inf inf"/></actuator>'),
        ('', '<tendon><fixed range="-inf inf"><joint joint="j" coef="1"/></fixed></tendon>'),
        ('', '<sensor><jointpos joint="j" cutoff="inf"/></sensor>'),
    ],
)
def test_a_world_of_ranges_without_end_is_taken(loaded, tmp_path, joint, more):
    path = tmp_path / 'hall.xml'
    floor = '<geom type="plane" size="0 0 1"/>'
    door = f'<body pos="9 0 1"><joint name="j" {joint}/><geom size="0.1"/></body>'
    path.write_text(f'<mujoco><worldbody>{floor}{door}</worldbody>{more}</mujoco>')
    world = build_world(loaded, str(path))
    world.step(20)
    assert np.isfinite(world.data.qpos).all()


TRAMPOLINE = (
    '<flexcomp type="grid" count="9 9 1" spacing=".4 .4 .1" pos="0 0 -.03" name="cloth" dim="2" '
    'mass="5" radius=".02"><edge equality="true"/><pin gridrange="0 0 0 8"/>'
    '<pin gridrange="8 0 8 8"/></flexcomp>'
)


@pytest.mark.parametrize(
    ('geoms', 'told'),
    [
        ('<geom type="plane" size="1 1 1" pos="9 0 0" euler="0 -4 0"/>', 'ground 0.63 m'),
        ('<geom type="plane" size="1 1 1" pos="9 0 0"/>', ''),
        (TRAMPOLINE, ''),
        ('<geom type="box" size="1 1 .1" pos="0 0 -.1"/>', ''),
        ('<geom type="box" size="1 1 .1" pos="3 0 -.1"/>', 'is no ground below the robot'),
        ('<geom type="box" size="9 9 .1" pos="0 0 -2.1"/>', 'is the ground 2.00 m below'),
        ('<geom type="box" size="9 9 .1" contype="2" conaffinity="2"/>', 'no grou'),
        (
            '<geom name="top" type="box" size="9 9 1"/>',
            "deep in 'top' (on z = 0, at x 0.0, y 0.0)",
        ),
        ('<body name="oak"><joint/><geom size=".3"/></body>', "deep in 'oak'"),
        ('<geom size=".3"/>', "deep in 'a sphere'"),
        ('<geom name="hut" type="mesh" mesh="hut"/>', "deep in 'hut', which is solid as its"),
    ],
)
def test_a_world_file_with_no_place_for_the_robot_is_told(loaded, tmp_path, caplog, geoms, told):
    path = tmp_path / 'hall.xml'
    hut = '<mesh name="hut" vertex="-3 -3 0 3 -3 0 3 3 0 -3 3 0 -3 -3 3 3 -3 3 3 3 3 -3 3 3"/>'
    path.write_text(f'<mujoco><asset>{hut}</asset><worldbody>{geoms}</worldbody></mujoco>')
    build_world(loaded, str(path))
    assert [told in line and str(path) in line for line in caplog.messages] == [True] * bool(told)
    robots = [
        (prefix, loaded, RobotSetup(place=(y, 0.0))) for prefix, y in (('a/', 0.1), ('b/', 0.7))
    ]
    caplog.clear()
    build_shared_world(robots, str(path))
    assert bool(caplog.messages) == bool(told)


def test_a_world_of_gazebo_is_told_by_its_kind(loaded, tmp_path):
    path = tmp_path / 'sun.xml'
    path.write_text('<sdf><world><include><uri>model://sun</uri></include></world></sdf>')
    with pytest.raises(SimulationError, match=f"^{path}: .*model type: 'sdf'"):
        build_world(loaded, str(path))


def test_a_world_that_is_there_and_no_file_is_not_called_missing(loaded, tmp_path):
    os.mkfifo(tmp_path / 'pipe.xml')
    (tmp_path / 'folder.xml').mkdir()
    for name, found in (('pipe.xml', 'a device or pipe'), ('folder.xml', 'a folder')):
        with pytest.raises(SimulationError) as caught:
            build_world(loaded, str(tmp_path / name))
        assert str(caught.value) == f'--world {tmp_path}/{name}: is {found}, wanted a file'


def test_a_world_that_is_no_xml_is_told_in_words_with_its_line(loaded, tmp_path):
    path = tmp_path / 'world.xml'
    cut = MJCF.replace('<worldbody>', '\n<worldbody>').removesuffix('</worldbody></mujoco>')
    for text, line in ((MJCF.encode('utf-16'), 1), (cut.encode(), 2), (b'\n', 1)):
        path.write_bytes(text)
        with pytest.raises(SimulationError) as caught:
            build_world(loaded, str(path))
        assert str(caught.value) == f'{path}: not well-formed XML in UTF-8, line {line}'
    outer = tmp_path / 'outer.xml'
    outer.write_text('<mujoco>\n<include file="world.xml"/></mujoco>')
    path.write_text(cut)
    with pytest.raises(
        SimulationError, match="'not well-formed XML in UTF-8, line 2' Element 'inc"
    ):
        build_world(loaded, str(outer))


def test_a_mesh_of_a_package_in_a_world_is_told_with_the_cure(loaded, tmp_path):
    path = tmp_path / 'house.urdf'
    mesh = '<geometry><mesh filename="package://house/hut.stl"/></geometry>'
    link = f'<link name="hut"><collision>{mesh}</collision></link>'
    path.write_text(f'<robot name="house">{link}</robot>')
    with pytest.raises(SimulationError, match='hut.stl.* no packages, give the path from its own'):
        build_world(loaded, str(path))


def test_a_name_in_a_world_that_is_not_utf_8_is_told(loaded, tmp_path):
    path = tmp_path / 'world.xml'
    declared = '<?xml version="1.0" encoding="latin-1"?>'
    path.write_bytes((declared + MJCF.replace('crate', 'Tür')).encode('latin-1'))
    with pytest.raises(SimulationError) as caught:
        build_world(loaded, str(path))
    assert str(caught.value) == f'{path}: a name in it is not UTF-8 text'
