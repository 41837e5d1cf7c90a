# SPDX-License-Identifier: Apache-2.0
"""Robots as other people describe them load into MuJoCo, or are refused in one line."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from cases import for_all
import mujoco
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot, parse_description
from robot_description.meshes import load as mesh_files
from robot_description.meshes.load import load_mesh, mesh_points
from robot_description.mujoco.builder import to_mujoco
from robot_description.packages import share_directory
from robot_description.robot import credible_inertias, impossible_inertias, possible_inertia
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError

pytestmark = pytest.mark.long

ROBOTS = share_directory('example-robot-data') / 'robots'
# What cannot be loaded, and why.
REFUSED = {
    'alex_description/urdf/alex_psyonic_hands.urdf': "'Left_index_q2' mimics joint 'index_q1'",
    'hector_description/robots/quadrotor_base.urdf.xacro': 'the description has no links',
    'hector_description/robots/quadrotor_base.xacro': 'quadrotor_base.urdf.xacro: no such file',
    'romeo_description/urdf/romeo.urdf': "'LFinger11Link' moves (joint 'LHand') but has no mass",
    'romeo_description/urdf/romeo_laas_small.urdf': "'l_gripper' moves",
    'ur_description/urdf/ur3.urdf': 'the description has no links',
}
DESCRIPTIONS = [
    name
    for path in sorted([*ROBOTS.rglob('*.urdf'), *ROBOTS.rglob('*.xacro')])
    if (name := str(path.relative_to(ROBOTS))) not in REFUSED
]
# What robots are by their shape, and by their tree.
KINDS = {
    'a1_description/urdf/a1.urdf': 'a quadruped',
    'anymal_b_simple_description/robots/anymal-kinova.urdf': 'a quadruped',
    'baxter_description/urdf/baxter.urdf': 'a robot of 2 arms',
    'bolt_description/robots/bolt.urdf': 'a biped',
    'centauro_description/urdf/centauro.urdf': 'a wheel-legged robot',
    'g1_description/urdf/g1_29dof_rev_1_0.urdf': 'a humanoid',
    'icub_description/robots/icub.urdf': 'a humanoid',
    'iris_description/robots/iris.urdf': 'a drone',
    'iris_description/robots/iris_simple.urdf': 'a drone',
    'kinova_description/robots/kinova.urdf': 'an arm',
    'panda_description/urdf/panda.urdf': 'an arm',
    'solo_description/robots/solo.urdf': 'a robot on 4 legs',
    'talos_data/robots/talos_reduced.urdf': 'a humanoid',
    'tiago_description/robots/tiago.urdf': 'a robot on two driven wheels',
    'tiago_pro_description/robots/tiago_pro.urdf': 'a skid-steer',
    'ur_description/urdf/ur10_robot.urdf': 'an arm',
    'ur_description/urdf/ur5_robot.urdf': 'an arm',
    'z1_description/urdf/z1.urdf': 'an arm',
}
TREES = {
    'a1_description/urdf/a1.urdf': 'quadruped',
    'b1_description/urdf/b1.urdf': 'quadruped',
    'laikago_description/urdf/laikago.urdf': 'quadruped',
    'anymal_c_simple_description/urdf/anymal.urdf': 'quadruped',
    'solo_description/robots/solo12.urdf': 'quadruped',
    'solo_description/robots/solo.urdf': 'other',
    'z1_description/urdf/z1.urdf': 'other',
    'g1_description/urdf/g1_29dof_rev_1_0.urdf': 'other',
    'iris_description/robots/iris.urdf': 'other',
}
URL = 'package://x/m.obj'

MASS = '<mass value="1"/>'
INERTIA = '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>'
INERTIAL = f'<inertial>{MASS}{INERTIA}</inertial>'
TETRAHEDRON = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'


def link(name, inside=INERTIAL):
    return f'<link name="{name}">{inside}</link>'


def joint(parent, child, kind='continuous', inside=''):
    return (
        f'<joint name="{parent}_{child}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>{inside}</joint>'
    )


def load(*elements, mesh_file=None, visuals=False):
    text = f'<robot name="r">{"".join(elements)}</robot>'
    robot = replace(parse_urdf(text), mesh_files={URL: mesh_file} if mesh_file else {})
    return to_mujoco(robot, visuals).compile()


def mesh(kind, filename=URL, scale='1 1 1'):
    geometry = f'<geometry><mesh filename="{filename}" scale="{scale}"/></geometry>'
    return f'<{kind}>{geometry}</{kind}>'


@pytest.fixture(scope='module', autouse=True)
def cache(tmp_path_factory) -> Iterator[None]:
    """Keep the cache of these tests to themselves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('XDG_CACHE_HOME', str(tmp_path_factory.mktemp('cache')))
        yield


@pytest.fixture
def tetrahedron(tmp_path) -> Path:
    path = tmp_path / 'tetrahedron.obj'
    path.write_text(TETRAHEDRON)
    return path


@pytest.mark.slow
@pytest.mark.parametrize('name', DESCRIPTIONS)
def test_a_robot_of_example_robot_data_loads_with_its_mass_and_sound_meshes_as_what_it_is(
    name, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    loaded = load_robot(str(ROBOTS / name), strict=True)
    if name in KINDS:
        assert loaded.nature.what.partition(' (')[0] == KINDS[name]
        assert loaded.nature.cure
    assert loaded.kind == TREES.get(name, loaded.kind)
    model = build_world(loaded).model
    assert model.body_mass.sum() == pytest.approx(loaded.robot.mass, abs=1e-6)
    hinges = {joint.name for joint in loaded.robot.movable_joints}
    assert {model.joint(i).name for i in range(model.njnt)} - {'root'} == hinges
    # MuJoCo leaves its warnings in a file where the user happens to be.
    assert not list(tmp_path.iterdir())


def test_each_robot_whose_kind_is_known_is_loaded():
    assert {*KINDS, *TREES} <= {*DESCRIPTIONS}


@pytest.mark.slow
@for_all(('name', 'said'), REFUSED.items())
def test_what_cannot_be_loaded_is_said_in_one_line(name, said):
    with pytest.raises(DescriptionError) as caught:
        build_world(load_robot(str(ROBOTS / name)))
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(ROBOTS / name))
    assert '\n' not in str(caught.value)


@pytest.mark.slow
def test_a_quadruped_floats_on_twelve_motors_and_shows_its_meshes():
    loaded = load_robot(str(ROBOTS / 'a1_description/urdf/a1.urdf'))
    model = build_world(loaded, visuals=True).model
    assert (model.nq, model.nv, model.nu) == (19, 18, 12)
    wanted = {shape.url for link in loaded.robot.links.values() for shape in link.visuals}
    assert model.nmesh >= len(wanted - {''})


@pytest.mark.slow
def test_what_collides_with_a_mesh_does_so_unseen_too(tetrahedron):
    elements = [link('a', INERTIAL + mesh('collision', scale='0.1 0.1 0.1'))]
    for visuals in (False, True):
        model = load(*elements, mesh_file=tetrahedron, visuals=visuals)
        assert model.nmesh == 1
        assert model.geom_contype.tolist() == [1]
        np.testing.assert_allclose(model.geom_rbound, [0.1], rtol=0.3)


def test_a_missing_collision_mesh_is_said_with_its_link_and_url():
    with pytest.raises(DescriptionError, match=r"'a' collides .* package://x/m.obj not found"):
        load(link('a', INERTIAL + mesh('collision')))


@pytest.mark.slow
def test_a_mirrored_mesh_is_not_inside_out(tetrahedron):
    model = load(
        link('a', INERTIAL + mesh('visual') + mesh('visual', scale='1 -1 1')),
        mesh_file=tetrahedron,
        visuals=True,
    )
    assert model.nmesh == 2
    for index in range(2):
        vertices = model.mesh(index).vertadr[0] + np.arange(model.mesh(index).vertnum[0])
        faces = model.mesh(index).faceadr[0] + np.arange(model.mesh(index).facenum[0])
        corners = model.mesh_vert[vertices][model.mesh_face[faces]].astype(float)
        # The signed volume is positive when all triangles face outwards.
        assert np.linalg.det(corners).sum() / 6.0 == pytest.approx(1 / 6, rel=1e-5)


def test_several_materials_in_one_visual_count_as_the_first():
    # As in Unitree's flat Go2 description since 2025.
    materials = ''.join(
        f'<material name="{name}"><color rgba="{rgba}"/></material>'
        for name, rgba in (('红', '1 0 0 1'), ('绿', '0 1 0 1'), ('蓝', '0 0 1 1'))
    )
    box = f'<visual><geometry><box size="1 1 1"/></geometry>{materials}</visual>'
    model = load(link('a', INERTIAL + box), visuals=True)
    np.testing.assert_allclose(model.geom_rgba, [[1.0, 0.0, 0.0, 1.0]])


def test_a_material_may_be_defined_elsewhere_or_nowhere():
    visual = '<visual><geometry><box size="1 1 1"/></geometry><material name="{}"/></visual>'
    known = '<material name="leaf"><color rgba="0 1 0 1"/></material>'
    shapes = visual.format('leaf') + visual.format('moon')
    model = load(known, link('a', INERTIAL + shapes), visuals=True)
    np.testing.assert_allclose(model.geom_rgba[0], [0.0, 1.0, 0.0, 1.0])
    assert model.ngeom == 2


def test_links_without_an_inertial_weigh_nothing_whatever_their_shape():
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    model = load(link('a'), link('b', box), joint('a', 'b', 'fixed'))
    assert model.body_mass.sum() == 1.0


@for_all('empty', ['', '<inertial><mass value="0"/></inertial>'])
def test_a_wheel_without_mass_is_refused_with_a_cure(empty):
    with pytest.raises(DescriptionError, match=r"'b' moves \(joint 'a_b'\) .* <inertial>"):
        load(link('a'), link('b', empty), joint('a', 'b'))


def test_a_link_between_two_joints_may_be_without_mass():
    # A hip of two crossing axes, as human models have it.
    model = load(link('a'), link('b', ''), link('c'), joint('a', 'b'), joint('b', 'c'))
    assert model.nv == 6 + 2
    assert model.body_mass.sum() == pytest.approx(2.0, abs=1e-6)


def test_a_root_without_mass_takes_that_of_what_is_welded_to_it():
    model = load(link('base', ''), link('trunk'), joint('base', 'trunk', 'fixed'))
    assert (model.nq, model.body_mass.sum()) == (7, 1.0)


def test_a_robot_that_hangs_on_the_world_stays_there_with_its_whole_mass():
    model = load(
        link('world', ''), link('a'), link('b'), joint('world', 'a', 'fixed'), joint('a', 'b')
    )
    assert (model.nq, model.nv) == (1, 1)
    assert model.body_mass.sum() == 2.0
    assert model.body('a').weldid == model.body('world').id


@for_all('principal', [(1.0, 1.0, 3.0), (-1.0, 1.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)])
def test_an_impossible_inertia_becomes_the_nearest_possible(principal):
    mended = possible_inertia(np.diag(principal), 1.0)
    assert mended is not None
    a, b, c = np.linalg.eigvalsh(mended)
    assert a > 0.0
    assert a + b > c
    assert possible_inertia(mended, 1.0) is None


@for_all('principal', [(1.0, 1.0, 1.0), (1.0, 1.0, 1.999), (2e-7, 3e-7, 4e-7)])
def test_a_possible_inertia_stays_as_it_is(principal):
    assert possible_inertia(np.diag(principal), 1.0) is None


@for_all(
    ('principal', 'lines'),
    [((0, 0, 0), 0), ((0, 1, 1), 0), ((1, 1, 2), 0), ((1, 1, 2.0001), 0), ((1, 1, 3), 1)],
)
def test_an_impossible_inertia_is_said_but_not_a_point_or_a_rod(principal, lines):
    xx, yy, zz = principal
    inertia = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>'
    text = f'<robot name="r">{link("a", f"<inertial>{MASS}{inertia}</inertial>")}</robot>'
    assert len(impossible_inertias(parse_urdf(text))) == lines


def test_a_point_mass_loads():
    zero = INERTIA.replace('1e-3', '0')
    model = load(link('a', f'<inertial>{MASS}{zero}</inertial>'))
    assert model.body_mass.sum() == 1.0
    assert (model.body_inertia[1] > 0.0).all()
    assert mujoco.MjData(model).qpos.shape == (7,)


def test_a_capsule_is_as_long_as_its_cylinder_and_two_balls():
    model = load(
        link('a', INERTIAL + '<collision><geometry><capsule radius="0.1" length="0.4"/></geometry>'
             '</collision>')
    )  # fmt: skip
    assert model.geom_type.tolist() == [mujoco.mjtGeom.mjGEOM_CAPSULE]
    np.testing.assert_allclose(model.geom_aabb[0, 3:], [0.1, 0.1, 0.3])


@pytest.mark.slow
def test_the_points_of_a_mesh_are_those_of_its_file_scaled(tetrahedron):
    text = f'<robot name="r">{link("a", mesh("visual", "tetrahedron.obj", "1 1 -2"))}</robot>'
    robot = parse_description(text, tetrahedron.parent / 'r.urdf').robot
    points = mesh_points(robot, robot.links['a'].visuals[0])
    np.testing.assert_allclose(points.min(axis=0), (0.0, 0.0, -2.0))
    assert mesh_points(parse_urdf(text), robot.links['a'].visuals[0]) is None


def test_a_mesh_is_read_once_to_be_measured_often_and_again_when_it_changes(
    tetrahedron, monkeypatch
):
    text = f'<robot name="r">{link("a", mesh("visual", "tetrahedron.obj", "1 1 1"))}</robot>'
    robot = parse_description(text, tetrahedron.parent / 'r.urdf').robot
    read = []
    monkeypatch.setattr(
        'robot_description.meshes.load.load_mesh',
        lambda path: read.append(path) or load_mesh(path),
    )
    (shape,) = robot.links['a'].visuals
    first = mesh_points(robot, shape)
    first *= 9.0  # who measures may change what it gets
    assert mesh_points(robot, shape).max() == 1.0
    tetrahedron.write_text(tetrahedron.read_text().replace('v 1 0 0', 'v 12 0 0'))
    assert mesh_points(robot, shape).max() == 12.0
    assert len(read) == 2


def test_a_mesh_that_is_drawn_and_collides_is_opened_once_to_be_measured(tetrahedron, monkeypatch):
    opened = []
    monkeypatch.setattr('robot_description.meshes.load._check_beginning', opened.append)
    meshes = mesh('visual', 'tetrahedron.obj') + mesh('collision', 'tetrahedron.obj', '2 2 2')
    text = f'<robot name="r">{link("a", INERTIAL + meshes)}</robot>'
    robot = parse_description(text, tetrahedron.parent / 'r.urdf').robot
    assert len(robot.links['a'].shapes) == 2
    assert opened == [tetrahedron]


@pytest.mark.slow
def test_as_many_meshes_as_a_humanoid_has_are_decoded_once_at_its_first_start(
    tmp_path, monkeypatch
):
    decoded = []
    decode = mesh_files._read_mesh
    monkeypatch.setattr(
        mesh_files, '_read_mesh', lambda path: decoded.append(path) or decode(path)
    )
    names = [f'{number}.obj' for number in range(50)]
    for name in names:
        # Each of its own contents: equal ones are decoded once anyway.
        (tmp_path / name).write_text(f'{TETRAHEDRON}# {name}\n')
    meshes = ''.join(mesh('collision', name, '0.1 0.1 0.1') for name in names)
    text = f'<robot name="r">{link("a", INERTIAL + meshes)}</robot>'
    to_mujoco(parse_description(text, tmp_path / 'r.urdf').robot)
    assert sorted(path.name for path in decoded) == sorted(names)


@for_all(('moment', 'is_mended'), [('1e-3', False), ('1', False), ('60', True)])
def test_an_inertia_of_a_body_ten_times_the_robot_becomes_that_of_a_ball(moment, is_mended):
    """A box of 1 m: a radius of gyration of 5 m is that of no link of it."""
    inertial = INERTIAL.replace('1e-3', moment)
    box = '<collision><geometry><box size="1 0.5 0.1"/></geometry></collision>'
    robot = parse_urdf(f'<robot name="r">{link("a", inertial + box)}</robot>')
    mended, lines = credible_inertias(robot)
    inertia = 0.4 * 0.5**2 if is_mended else float(moment)
    np.testing.assert_allclose(mended.links['a'].inertia, inertia * np.eye(3))
    assert [line[:34] for line in lines] == ["inertia of 1 links ('a' has 60 kg "] * is_mended
