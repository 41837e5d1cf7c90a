# SPDX-License-Identifier: Apache-2.0
"""Meshes are found wherever a package keeps them; without them primitives are shown."""

from dataclasses import replace
from pathlib import Path

from descriptions import robot_named
import mujoco
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from robot_description.meshes import load
from robot_description.meshes.load import load_mesh
from robot_description.meshes.resolver import mesh_shapes
from robot_description.mujoco.builder import to_mujoco
from robot_description.mujoco.geoms import VISUAL_GROUP
from robot_description.urdf import parse_urdf

URL = 'package://example-robot-data/robots/go2_description/visuals/{}.dae'
TETRAHEDRON = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    """Keep the cache of these tests to themselves."""
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    return tmp_path / 'cache/wasd/meshes'


@pytest.fixture
def tetrahedron(tmp_path) -> Path:
    path = tmp_path / 'tetrahedron.obj'
    path.write_text(TETRAHEDRON)
    return path


@pytest.fixture(scope='module')
def urdf() -> str:
    return robot_named('go2').urdf


def shown(model, body):
    """Return the kinds of the geoms of a body that are drawn."""
    first, count = model.body(body).geomadr[0], model.body(body).geomnum[0]
    geoms = range(first, first + count)
    return [int(model.geom_type[g]) for g in geoms if model.geom_group[g] == VISUAL_GROUP]


@pytest.mark.slow
def test_our_own_robots_meshes_are_where_their_descriptions_say():
    for name, count in (('go2', 7), ('mbot', 0)):
        report = load_robot(name, strict=True).meshes
        assert report.repairs == ()
        assert len(report.files) == count


def test_a_mesh_is_triangles_in_metres(tetrahedron):
    mesh = load_mesh(tetrahedron)
    assert mesh.vertices.shape == (4, 3)
    assert mesh.faces.shape == (4, 3)
    np.testing.assert_array_equal(mesh.vertices.max(axis=0), [1.0, 1.0, 1.0])


@pytest.mark.slow
def test_the_go2s_trunk_has_the_size_of_a_go2():
    path = robot_named('go2').meshes.files[URL.format('base')]
    size = np.ptp(load_mesh(path).vertices, axis=0)
    # Longer than the hips are apart (0.39 m), shorter than the whole Go2 (0.70 m); z is up.
    np.testing.assert_allclose(size, [0.46, 0.19, 0.19], atol=0.02)


def test_a_mesh_is_decoded_once(tetrahedron, cache, monkeypatch):
    first = load_mesh(tetrahedron)
    assert len(list(cache.iterdir())) == 1
    monkeypatch.setattr(load, '_read_mesh', lambda path: pytest.fail('decoded again'))
    for one, other in zip(first, load_mesh(tetrahedron), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_changed_mesh_is_decoded_again(tetrahedron):
    load_mesh(tetrahedron)
    tetrahedron.write_text(TETRAHEDRON.replace('v 1 0 0', 'v 2 0 0'))
    assert load_mesh(tetrahedron).vertices.max() == 2.0


@pytest.mark.parametrize('content', [b'', b'PK\x03\x04 not an archive', b'nonsense'])
def test_a_broken_cache_is_written_anew(tetrahedron, cache, content):
    load_mesh(tetrahedron)
    (entry,) = cache.iterdir()
    entry.write_bytes(content)
    assert len(load_mesh(tetrahedron).faces) == 4
    assert entry.stat().st_size > len(content)


def test_a_cache_that_cannot_be_written_is_none(tetrahedron, tmp_path, monkeypatch):
    (tmp_path / 'file').touch()
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'file'))
    assert len(load_mesh(tetrahedron).faces) == 4


@pytest.mark.parametrize('name', ['broken.dae', 'broken.stl', 'broken.obj', 'broken.unknown'])
def test_what_is_no_mesh_is_a_value_error_in_one_line(tmp_path, name):
    (tmp_path / name).write_text('this is no mesh\n')
    with pytest.raises(ValueError, match=name) as caught:
        load_mesh(tmp_path / name)
    assert '\n' not in str(caught.value)


@pytest.mark.slow
def test_every_link_of_the_go2_is_drawn_with_its_mesh():
    world = build_world(robot_named('go2'), visuals=True)
    mesh, lidar = shown(world.model, 'base')
    assert (mesh, lidar) == (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_CYLINDER)
    for leg in ('FL', 'FR', 'RL', 'RR'):
        for part in ('hip', 'thigh', 'calf'):
            assert mujoco.mjtGeom.mjGEOM_MESH in shown(world.model, f'{leg}_{part}')
    assert (world.model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).sum() == 17
    assert world.model.nmesh == 7


@pytest.mark.slow
def test_meshes_weigh_nothing_and_touch_nothing():
    plain, drawn = (build_world(robot_named('go2'), visuals=v).model for v in (False, True))
    np.testing.assert_array_equal(plain.body_mass, drawn.body_mass)
    np.testing.assert_array_equal(plain.body_inertia, drawn.body_inertia)
    meshes_drawn = drawn.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    assert not drawn.geom_contype[meshes_drawn].any()
    assert not drawn.geom_conaffinity[meshes_drawn].any()
    assert plain.nmesh == 0


@pytest.mark.slow
def test_drawing_does_not_change_what_happens():
    def fall(visuals):
        world = build_world(robot_named('go2'), visuals=visuals)
        world.data.qpos[2] = 0.5
        world.step(400)
        return world.data.qpos.copy()

    np.testing.assert_array_equal(fall(False), fall(True))


@pytest.mark.slow
def test_a_missing_mesh_shows_primitives_instead(urdf):
    found = robot_named('go2').meshes.files
    files = {url: file for url, file in found.items() if 'thigh' not in url}
    robot = replace(parse_urdf(urdf), mesh_files=files)
    model = to_mujoco(robot, visuals=True).compile()
    assert shown(model, 'FL_thigh') == [mujoco.mjtGeom.mjGEOM_BOX]
    assert mujoco.mjtGeom.mjGEOM_MESH in shown(model, 'FL_calf')


@pytest.mark.slow
def test_without_any_mesh_it_loads_and_shows_primitives(urdf):
    model = to_mujoco(parse_urdf(urdf), visuals=True).compile()
    assert model.nmesh == 0
    assert model.body_mass.sum() == pytest.approx(16.086)
    for body in ('base', 'FL_hip', 'RR_thigh', 'RL_calf'):
        assert shown(model, body), body


def test_a_mesh_that_cannot_be_read_shows_primitives_too_and_is_said(urdf, tmp_path, caplog):
    broken = tmp_path / 'broken.dae'
    broken.write_text('<COLLADA>')
    robot = parse_urdf(urdf)
    robot = replace(robot, mesh_files={shape.url: broken for shape, _ in mesh_shapes(robot)})
    model = to_mujoco(robot, visuals=True).compile()
    assert model.nmesh == 0
    assert shown(model, 'FL_thigh') == [mujoco.mjtGeom.mjGEOM_BOX]
    assert all('visual mesh left out' in record.message for record in caplog.records)
    assert str(broken) in caplog.text
