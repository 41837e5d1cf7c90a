# SPDX-License-Identifier: Apache-2.0
"""Mesh files are opened: what is wrong with one is said with its cure, and stops nothing."""

from collections.abc import Callable
import gzip
import json
import os
from pathlib import Path
import re

import mujoco
import numpy as np
import PIL.Image
import pytest
from robot_description.description import load_robot
from robot_description.lint.session import lint
from robot_description.meshes import load
from robot_description.meshes.load import load_mesh
from robot_description.mujoco.builder import compile_model, to_mujoco
from robot_description.xacro.session import XacroSession
from wasd_core.errors import DescriptionError

FORMATS = ('stl', 'obj', 'ply', 'glb', 'dae')
POINTER = b'version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12345\n'
MASS = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
BOX = '<geometry><box size="0.2 0.2 0.2"/></geometry>'


def mesh(name: str, scale: str = '1 1 1') -> str:
    return f'<geometry><mesh filename="{name}" scale="{scale}"/></geometry>'


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))


@pytest.fixture
def robot(tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that writes a robot of one link, `a`, with these shapes."""

    def write(shapes: str) -> Path:
        path = tmp_path / 'robot.urdf'
        path.write_text(f'<robot name="robot"><link name="a">{MASS}{shapes}</link></robot>')
        return path

    return write


@pytest.fixture(scope='module')
def balls() -> dict[str, bytes]:
    """Return a ball of radius 0.1 m in each format."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    exported = {name: ball.export(file_type=name) for name in FORMATS}
    return {k: v.encode() if isinstance(v, str) else v for k, v in exported.items()}


def model_of(path: Path, visuals: bool = True) -> mujoco.MjModel:
    loaded = load_robot(str(path))
    return compile_model(to_mujoco(loaded.robot, visuals))


BROKEN = {
    'is empty': lambda whole: b'',
    'git lfs pull': lambda whole: POINTER,
    'is gzipped; unpack it': gzip.compress,
    'is a web page': lambda whole: b'<!DOCTYPE html>\n<html/>',
    'is a .glb file by its content|is a .dae file': lambda whole: whole,
    'cannot be read as a mesh|no triangles': lambda whole: whole[: len(whole) // 2],
    'cannot be read|no triangles': lambda whole: np.random.default_rng(1).bytes(3000),
}


@pytest.mark.parametrize('suffix', FORMATS)
@pytest.mark.parametrize('said', BROKEN)
def test_what_is_wrong_with_a_file_is_said_in_one_line(said, suffix, balls, tmp_path):
    whole = balls[suffix]
    if said.startswith('is a .glb'):
        whole = balls['dae' if suffix == 'glb' else 'glb']
    path = tmp_path / f'ball.{suffix}'
    path.write_bytes(BROKEN[said](whole))
    if said.startswith('is a .glb') and suffix == 'glb':
        said = 'cannot be read'
    with pytest.raises(ValueError, match=f'ball.{suffix}: .*({said})') as caught:
        load_mesh(path)
    assert '\n' not in str(caught.value)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('number', ['1e300', '1e30', 'nan'])
@pytest.mark.parametrize('suffix', ['obj', 'stl'])
def test_points_that_are_no_lengths_make_no_mesh(suffix, number, tmp_path):
    points = f'0 0 0,{number} 0 0,0 1 0'.split(',')
    path = tmp_path / f'far.{suffix}'
    if suffix == 'stl':
        corners = ' '.join(f'vertex {point}' for point in points)
        facet = f'facet normal 0 0 1 outer loop {corners} endloop endfacet'
        path.write_text(f'solid far\n{facet}\nendsolid far\n')
    else:
        path.write_text(''.join(f'v {point}\n' for point in points) + 'f 1 2 3\n')
    with pytest.raises(ValueError, match=f'far.{suffix}: '):
        load_mesh(path)


@pytest.mark.filterwarnings('error')
def test_a_scale_that_makes_a_mesh_endless_is_refused(robot, balls, tmp_path):
    (tmp_path / 'ball.stl').write_bytes(balls['stl'])
    path = robot(f'<collision>{mesh("ball.stl", "1e300 1 1")}</collision>')
    (record,) = load_robot(str(path)).meshes.repairs
    assert (record.kind, 'its scale makes it 2e+299 m large' in record.note) == ('unusable', True)


@pytest.mark.parametrize('suffix', ['step', 'fbx', 'off'])
def test_a_format_that_is_not_read_is_told_those_that_are(suffix, tmp_path):
    path = tmp_path / f'part.{suffix}'
    path.write_text('OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n')
    with pytest.raises(ValueError, match='no mesh by its name: export it as .obj, .stl, .dae'):
        load_mesh(path)


def test_a_binary_stl_may_have_something_behind_its_end(balls, tmp_path):
    path = tmp_path / 'ball.stl'
    path.write_bytes(balls['stl'] + b'made by somebody')
    assert len(load_mesh(path).faces) == 320


@pytest.mark.parametrize('use', ['visual', 'collision'])
@pytest.mark.parametrize(('name', 'kind'), [('lost.stl', 'missing'), ('pointer.stl', 'unusable')])
def test_a_mesh_that_is_lost_stops_nothing_but_strict(use, name, kind, robot, tmp_path):
    (tmp_path / 'pointer.stl').write_bytes(POINTER)
    path = robot(f'<{use}>{mesh(name)}</{use}>')
    (record,) = load_robot(str(path)).meshes.repairs
    assert (record.kind, record.file) == (kind, None)
    assert model_of(path).ngeom == 0
    assert f'{kind}-mesh' in [one.rule.code for one in lint(XacroSession(path))]
    with pytest.raises(DescriptionError, match=f'--strict: {use} mesh .*{name}.*: {kind}'):
        load_robot(str(path), strict=True)


def test_what_is_drawn_collides_in_place_of_a_lost_mesh(robot):
    path = robot(f'<visual>{BOX}</visual><collision>{mesh("lost.stl")}</collision>')
    loaded = load_robot(str(path))
    assert 'what is drawn collides instead' in loaded.meshes.repairs[0].line()
    assert [shape.kind for shape in loaded.robot.links['a'].collisions] == ['box']
    model = model_of(path)
    assert (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).all()
    assert sorted(model.geom_contype) == [0, 1]


def test_one_of_several_collisions_is_just_left_out(robot):
    collisions = f'<collision>{BOX}</collision><collision>{mesh("lost.stl")}</collision>'
    path = robot(f'<visual>{BOX}</visual>{collisions}')
    assert ', left out' in load_robot(str(path)).meshes.repairs[0].line()
    assert model_of(path, visuals=False).ngeom == 1


SIZES = [
    (1.0, '1 1 1', ''),
    (1000.0, '1 1 1', 'looks like millimetres: scale="0.001 0.001 0.001"'),
    (1000.0, '1 -1 1', 'looks like millimetres: scale="0.001 -0.001 0.001"'),
    (1000.0, '0.001 0.001 0.001', ''),
    (1.0, '0.001 0.001 0.001', 'scaled from millimetres twice: scale="1 1 1"'),
    (1e6, '1 1 1', 'check its unit and scale'),
    (20.0, '1 1 1', ''),
    (0.02, '1 1 1', ''),
]


@pytest.mark.parametrize(('size', 'scale', 'said'), SIZES)
def test_a_size_is_compared_with_the_robot(size, scale, said, robot, tmp_path):
    import trimesh

    trimesh.creation.box((0.2 * size, 0.1 * size, 0.1 * size)).export(tmp_path / 'box.stl')
    path = robot(f'<visual>{mesh("box.stl", scale)}</visual><collision>{BOX}</collision>')
    found = [one.message for one in lint(XacroSession(path)) if one.rule.code == 'mesh-size']
    (record,) = load_robot(str(path)).meshes.records
    assert (record.kind == 'size') == bool(said) == bool(found)
    assert record.file is not None
    for text in (record.note, *found):
        assert said in text
    if size == 1000.0 and said:
        assert '200 x 100 x 100 m' in record.line()


def test_a_flat_mesh_collides_as_a_thin_plate(robot, tmp_path):
    (tmp_path / 'flat.obj').write_text('v 0 0 0\nv 1 0 1\nv 1 1 1\nf 1 2 3\n')
    path = robot(f'<visual>{mesh("flat.obj")}</visual><collision>{mesh("flat.obj")}</collision>')
    model = model_of(path)
    assert model.nmesh == 2
    (touched,) = np.flatnonzero(model.geom_contype)
    size = 2.0 * model.geom_aabb[touched, 3:]
    assert size.min() == pytest.approx(1e-3, rel=1e-3)


def test_a_mesh_is_decoded_once_to_be_measured_and_simulated(robot, balls, tmp_path, monkeypatch):
    (tmp_path / 'ball.obj').write_bytes(balls['obj'])
    read, decode = [], load._read_mesh
    monkeypatch.setattr(load, '_read_mesh', lambda path: read.append(path) or decode(path))
    path = robot(f'<visual>{mesh("ball.obj")}</visual><collision>{mesh("ball.obj")}</collision>')
    assert model_of(path).nmesh == 2
    assert lint(XacroSession(path)) == []
    assert len(read) == 1


def test_files_of_one_name_stay_apart(robot, tmp_path):
    import trimesh

    for name, size in (('one', 0.1), ('other', 0.3)):
        (tmp_path / name).mkdir()
        trimesh.creation.box((size,) * 3).export(tmp_path / name / 'box.stl')
    path = robot(
        ''.join(f'<visual>{mesh(f"{name}/box.stl")}</visual>' for name in ('one', 'other'))
    )
    np.testing.assert_allclose(2.0 * model_of(path).geom_aabb[:, 3], [0.1, 0.3], rtol=1e-6)


@pytest.mark.parametrize('suffix', FORMATS)
def test_a_mesh_that_would_take_gigabytes_is_left_out_with_a_line(suffix, robot, tmp_path, caplog):
    with open(tmp_path / f'huge.{suffix}', 'wb') as file:
        file.truncate(190_000_000)
    loaded = load_robot(str(robot(f'<visual>{mesh(f"huge.{suffix}")}</visual>')))
    (record,) = loaded.meshes.records
    assert (record.kind, record.file) == ('unusable', None)
    assert '190 MB, at most 52 are read: reduce it' in caplog.text


def test_a_gltf_file_counts_with_what_lies_beside_it(tmp_path):
    path = gltf(tmp_path, 'data.bin')
    data = (tmp_path / 'data.bin').read_bytes()
    assert load_mesh(path).faces.shape == (1, 3)
    with open(tmp_path / 'data.bin', 'wb') as file:
        file.write(data)
        file.truncate(99_000_000)
    with pytest.raises(ValueError, match=r'data.bin: 99.0 MB is too much'):
        load._read_mesh(path)


def test_a_gltf_file_reads_no_pipe_and_nothing_from_elsewhere(tmp_path):
    (tmp_path / 'in').mkdir()
    path = gltf(tmp_path / 'in', '../data.bin')
    with pytest.raises(ValueError, match="'../data.bin' is not in .*: put it there"):
        load_mesh(path)
    path = gltf(tmp_path / 'in', 'pipe')
    (tmp_path / 'in/pipe').unlink()
    os.mkfifo(tmp_path / 'in/pipe')
    with pytest.raises(ValueError, match='is a device or pipe'):
        load_mesh(path)


def test_a_gltf_file_that_is_a_link_is_read_with_what_lies_beside_its_file(tmp_path):
    for folder in ('source', 'install'):
        (tmp_path / folder).mkdir()
    path = gltf(tmp_path / 'source', 'data.bin')
    for name in (path.name, 'data.bin'):  # as colcon build --symlink-install has them
        (tmp_path / 'install' / name).symlink_to(path.parent / name)
    assert load._read_mesh(tmp_path / 'install' / path.name).faces.shape == (1, 3)


def gltf(folder, uri):
    """Return a glTF file of one triangle whose points are in another file."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    (folder / uri).write_bytes(points.tobytes())
    (path := folder / 'part.gltf').write_text(
        json.dumps(
            {
                'asset': {'version': '2.0'},
                'scenes': [{'nodes': [0]}],
                'nodes': [{'mesh': 0}],
                'meshes': [{'primitives': [{'attributes': {'POSITION': 0}}]}],
                'accessors': [
                    {'bufferView': 0, 'componentType': 5126, 'count': 3, 'type': 'VEC3'}
                ],
                'bufferViews': [{'buffer': 0, 'byteLength': points.nbytes}],
                'buffers': [{'uri': uri, 'byteLength': points.nbytes}],
            }
        )
    )
    return path


def test_an_ascii_stl_in_capitals_and_with_a_byte_order_mark_is_read(tmp_path):
    corners = ''.join(f'VERTEX {x} 0\n' for x in ('0 0', '1 0', '0 1'))
    facet = f'FACET NORMAL 0 0 1\nOUTER LOOP\n{corners}ENDLOOP\nENDFACET\n'
    path = tmp_path / 'part.stl'
    path.write_text(f'SOLID part\n{facet}ENDSOLID part\n', encoding='utf-8-sig')
    assert load_mesh(path).faces.shape == (1, 3)
    path.write_text(f'SOLID part\n{facet}')
    with pytest.raises(ValueError, match='there is no endsolid'):
        load_mesh(path)


def test_the_textures_of_a_mesh_are_not_read(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(PIL.Image, 'open', lambda *args, **_: opened.append(args))
    (tmp_path / 'skin.png').write_bytes(b'a picture')
    (tmp_path / 'part.mtl').write_text('newmtl a\nmap_Kd skin.png\nnewmtl b\nmap_Kd skin.png\n')
    points = ''.join(f'v {x}\nvt 0 0\n' for x in ('0 0 0', '1 0 0', '0 1 0', '0 0 1'))
    path = tmp_path / 'part.obj'
    path.write_text(f'mtllib part.mtl\n{points}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 4/4\n')
    mesh = load_mesh(path)
    assert (len(mesh.faces), opened) == (2, [])
    assert np.ptp(mesh.vertices, axis=0).tolist() == [1.0, 1.0, 1.0]


def test_a_collada_file_whose_nodes_repeat_each_other_is_refused_at_once(balls, tmp_path):
    text = balls['dae'].decode()
    (node,) = re.findall('<instance_geometry.*?</instance_geometry>', text, re.DOTALL)[:1]
    nodes = f'<node id="n0">{node}</node>'
    for level in range(1, 8):
        inside = 10 * f'<instance_node url="#n{level - 1}"/>'
        nodes += f'<node id="n{level}">{inside}</node>'
    bomb = text.replace(node, '<instance_node url="#n7"/>', 1)
    where = bomb.index('<library_visual_scenes')
    path = tmp_path / 'bomb.dae'
    path.write_text(f'{bomb[:where]}<library_nodes>{nodes}</library_nodes>{bomb[where:]}')
    with pytest.raises(ValueError, match='more than 10000 parts'):
        load_mesh(path)
