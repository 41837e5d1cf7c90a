# SPDX-License-Identifier: Apache-2.0
"""Meshes come in metres, z up, whole, whatever their format; and through a cache that holds."""

import multiprocessing
from pathlib import Path

import numpy as np
import pytest
from robot_description.description import load_robot
from robot_description.meshes.load import Detail, load_mesh
from robot_description.mujoco import geoms
from robot_description.mujoco.builder import to_mujoco
from terminals import PATIENCE

# One triangle, in no symmetric place.
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 3.0]])
INSTANCE = '<instance_geometry url="#g"/>'
COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="pa" count="9">0 0 0 1 0 0 0 2 3</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    return tmp_path / 'cache/wasd/meshes'


def collada(
    folder, up='Z_UP', unit='1', nodes=f'<node>{INSTANCE}</node>', more='', text=COLLADA
) -> np.ndarray:
    path = folder / 'mesh.dae'
    asset = f'{more}<unit name="u" meter="{unit}"/><up_axis>{up}</up_axis>'
    path.write_text(text.format(asset=asset, nodes=nodes))
    mesh = load_mesh(path)
    return mesh.vertices[mesh.faces].reshape(-1, 3)


@pytest.mark.parametrize('unit', [1.0, 0.001, 0.0254])
def test_collada_comes_in_metres_whatever_its_unit(tmp_path, unit):
    np.testing.assert_allclose(collada(tmp_path, unit=str(unit)), unit * POINTS, rtol=1e-6)


@pytest.mark.parametrize(
    ('up', 'last'), [('Z_UP', [0, 2, 3]), ('Y_UP', [0, -3, 2]), ('X_UP', [-2, -3, 0])]
)
def test_collada_comes_with_z_up(tmp_path, up, last):
    np.testing.assert_allclose(collada(tmp_path, up=up)[2], last)


def test_the_up_axis_that_meshlab_always_writes_means_nothing(tmp_path):
    more = '<contributor><authoring_tool>VCGLib | MeshLab</authoring_tool></contributor>'
    np.testing.assert_allclose(collada(tmp_path, up='Y_UP', more=more), POINTS)


def test_nodes_place_turn_and_scale_what_is_in_them_unit_last(tmp_path):
    inner = f'<node><rotate>0 0 1 90</rotate><scale>2 2 2</scale>{INSTANCE}</node>'
    nodes = f'<node><translate>10 0 0</translate>{inner}</node>'
    placed = collada(tmp_path, unit='0.1', nodes=nodes)
    np.testing.assert_allclose(placed, [[1, 0, 0], [1, 0.2, 0], [0.6, 0, 0.6]], atol=1e-6)


def test_every_geometry_of_a_file_is_there(tmp_path):
    matrix = '<matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix>'
    nodes = f'<node>{INSTANCE}</node><node>{matrix}{INSTANCE}</node>'
    both = collada(tmp_path, nodes=nodes)
    np.testing.assert_allclose(np.sort(both[:, 0]), [0, 0, 1, 5, 5, 6], atol=1e-6)


@pytest.mark.parametrize('ignores', [True, False], ids=['new', '0.7.2'])
def test_a_material_that_is_not_there_takes_nothing_away(tmp_path, monkeypatch, ignores):
    import collada as pycollada

    class Old(pycollada.Collada):
        """As Ubuntu 24.04 has it: what is broken is no less so for being ignored."""

        def __init__(self, file, ignore):
            super().__init__(file)

    if not ignores:
        monkeypatch.setattr(pycollada, 'Collada', Old)
    material = '<instance_material symbol="m" target="#nowhere"/>'
    bound = f'<bind_material><technique_common>{material}</technique_common></bind_material>'
    nodes = f'<node><instance_geometry url="#g">{bound}</instance_geometry></node>'
    np.testing.assert_allclose(collada(tmp_path, nodes=nodes), POINTS)


@pytest.mark.parametrize('semantic', ['NORMAL', 'TEXCOORD'])
def test_what_only_pictures_need_of_collada_is_not_read(tmp_path, semantic):
    # Numbers of it that are none, or too few, so take nothing away.
    place = '<input semantic="VERTEX" source="#v" offset="0"/>'
    more = f'{place}<input semantic="{semantic}" source="#n" offset="1"/>'
    names = '<param name="S" type="float"/><param name="T" type="float"/>'
    numbers = '<float_array id="na" count="9">no numbers</float_array>'
    accessor = f'<accessor source="#na" count="1" stride="2">{names}</accessor>'
    looks = f'<source id="n">{numbers}<technique_common>{accessor}</technique_common></source>'
    text = COLLADA.replace('<vertices', f'{looks}<vertices').replace(place, more)
    text = text.replace('<p>0 1 2</p>', '<p>0 7 1 8 2 9</p>')
    np.testing.assert_allclose(collada(tmp_path, text=text), POINTS)


@pytest.mark.parametrize('suffix', ['.stl', '.obj', '.ply', '.glb', '.dae'])
def test_every_format_gives_the_same_triangle(tmp_path, suffix):
    import trimesh

    path = tmp_path / f'mesh{suffix}'
    trimesh.Trimesh(POINTS, [[0, 1, 2]]).export(path)
    mesh = load_mesh(path)
    np.testing.assert_allclose(np.sort(mesh.vertices, axis=0), np.sort(POINTS, axis=0), atol=1e-6)


def test_gltf_of_other_programs_has_y_up(tmp_path):
    import trimesh

    path = tmp_path / 'mesh.glb'
    data = trimesh.Trimesh(POINTS, [[0, 1, 2]]).export(file_type='glb')
    path.write_bytes(data.replace(b'trimesh', b'blender'))
    np.testing.assert_allclose(load_mesh(path).vertices.max(axis=0), [1.0, 0.0, 2.0])


def test_a_file_too_large_to_be_a_mesh_is_not_read(tmp_path):
    path = tmp_path / 'huge.stl'
    with open(path, 'wb') as file:
        file.truncate(300_000_000)
    with pytest.raises(ValueError, match=r'huge.stl: 300 MB, at most 52'):
        load_mesh(path)


def big_mesh(folder: Path) -> Path:
    import trimesh

    path = folder / 'sphere.stl'
    trimesh.creation.icosphere(subdivisions=5).export(path)
    return path


@pytest.mark.slow
def test_processes_that_fill_the_cache_at_once_all_get_the_mesh(tmp_path, cache):
    path = big_mesh(tmp_path)
    context = multiprocessing.get_context('fork')
    start, sums = context.Barrier(3), context.Queue()

    def load() -> None:
        start.wait()
        sums.put(int(load_mesh(path).faces.sum()))

    processes = [context.Process(target=load) for _ in range(3)]
    for process in processes:
        process.start()
    assert {sums.get(timeout=PATIENCE) for _ in processes} == {int(load_mesh(path).faces.sum())}
    for process in processes:
        process.join()
    assert [entry.suffix for entry in cache.iterdir()] == ['.npz']


@pytest.mark.slow
def test_a_process_killed_while_it_writes_leaves_no_broken_mesh(tmp_path, cache):
    path = big_mesh(tmp_path)
    process = multiprocessing.get_context('fork').Process(target=load_mesh, args=(path,))
    process.start()
    while process.is_alive() and not (cache.is_dir() and any(cache.iterdir())):
        pass
    process.kill()
    process.join()
    (cache / 'half.part').write_bytes(b'PK')
    for _ in range(2):
        assert len(load_mesh(path).faces) == 20 * 4**5


@pytest.mark.slow
def test_a_thinned_surface_keeps_its_shape_and_has_no_gaps(tmp_path, cache):
    import trimesh

    thin = load_mesh(big_mesh(tmp_path), Detail(0.01, 2000, 3000))
    assert 1900 <= len(thin.faces) <= 2000
    surface = trimesh.Trimesh(*thin, process=False)
    assert surface.is_watertight
    np.testing.assert_allclose(np.linalg.norm(thin.vertices, axis=1), 1.0, atol=5e-3)
    assert surface.volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)


@pytest.mark.slow
def test_a_thinned_surface_and_the_whole_one_are_both_cached(tmp_path, cache):
    path = big_mesh(tmp_path)
    few = Detail(0.5, 100, 2000)
    counts = [len(load_mesh(path, most).faces) for most in (None, few, None, few)]
    assert counts[0] == counts[2] == 20480
    assert counts[1] == counts[3] < 2001
    assert len(list(cache.iterdir())) == 2


def test_a_detail_is_a_share_within_bounds_and_never_more_than_there_is():
    detail = Detail(0.5, 100, 1000)
    assert [detail.of(n) for n in (40, 150, 300, 1500, 9000)] == [40, 100, 150, 750, 1000]


@pytest.mark.slow
@pytest.mark.parametrize(('has_card', 'count'), [(True, 15_000), (False, 5000)])
def test_the_trunk_of_the_go2_is_drawn_whole_by_a_graphics_card(has_card, count, monkeypatch):
    monkeypatch.setattr(geoms, 'has_graphics_card', lambda: has_card)
    model = to_mujoco(load_robot('go2').robot, visuals=True).compile()
    assert count < model.mesh_facenum.max() < 1.1 * count
