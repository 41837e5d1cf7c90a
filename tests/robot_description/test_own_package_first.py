# SPDX-License-Identifier: Apache-2.0
"""A robot's own meshes come first, however they were moved; what is fixed goes anywhere."""

from collections.abc import Callable
import logging
from pathlib import Path
import shutil

import pytest
from robot_description.describe_command import main
from robot_description.description import load_robot
from robot_description.fix.mending import mend, write_mended
from robot_description.lint.session import lint
from robot_description.packages import installed_folders, share_directory
from robot_description.xacro.session import XacroSession

pytestmark = pytest.mark.slow

# Installed with the simulator; its trunk is visuals/base.dae, and it has no dae/.
NAME = 'go2_description'
TETRAHEDRON = 'v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'
MASS = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LINK = (
    '  <link name="{0}">\n    {2}\n    <visual><geometry>\n'
    '      <mesh filename="{1}"/>\n    </geometry></visual>\n  </link>\n'
)
JOINT = (
    '  <joint name="hip_joint" type="revolute">\n    <parent link="base"/><child link="hip"/>\n'
    '    <limit lower="-1" upper="1" effort="9" velocity="9"/>\n  </joint>\n'
)


def robot(trunk: str, hip: str) -> str:
    """Return the text of a robot of two links with these meshes."""
    links = LINK.format('base', trunk, MASS) + LINK.format('hip', hip, MASS)
    return f'<robot name="go2">\n{links}{JOINT}</robot>\n'


def write(folder: Path, *meshes: str, text: str = '', manifest: str = NAME) -> Path:
    """Write a package with these meshes, of different sizes, and its description's text."""
    for index, mesh in enumerate(meshes):
        (folder / mesh).parent.mkdir(parents=True, exist_ok=True)
        (folder / mesh).write_text(TETRAHEDRON.format(0.1 + index))
    path = folder / 'urdf/go2.urdf'
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        text or robot(f'package://{NAME}/dae/base.obj', f'package://{NAME}/dae/hip.obj')
    )
    if manifest:
        (folder / 'package.xml').write_text(f'<package><name>{manifest}</name></package>\n')
    return path


def renamed_beside(folder: Path) -> Path:
    return write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj')


def in_another_folder(folder: Path) -> Path:
    return write(folder / NAME, 'meshes/high/base.obj', 'meshes/high/hip.obj')


def renamed_in_another_folder(folder: Path) -> Path:
    return write(folder / NAME, 'meshes/visual/trunk.obj', 'dae/hip.obj')


def as_the_installed_one_has_it(folder: Path) -> Path:
    # The URL is right for the package that is installed, and for this one but for a letter.
    url = f'package://{NAME}/visuals/{{}}.dae'
    text = robot(url.format('base'), url.format('hip'))
    return write(folder / NAME, 'visuals/trunk.obj', 'visuals/hip.obj', text=text)


def linked_package(folder: Path) -> Path:
    write(folder / 'clones/robots/go2', 'dae/trunk.obj', 'dae/hip.obj')
    (folder / 'ws/src').mkdir(parents=True)
    (folder / 'ws/src' / NAME).symlink_to(folder / 'clones/robots/go2')
    return folder / 'ws/src' / NAME / 'urdf/go2.urdf'


def linked_description(folder: Path) -> Path:
    real = write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj')
    (folder / 'other').mkdir()
    (folder / 'other/go2.urdf').symlink_to(real)
    return folder / 'other/go2.urdf'


def copied_and_renamed(folder: Path) -> Path:
    # The original is beside it, and the installed package has the path as well.
    url = f'package://{NAME}/visuals/{{}}.dae'
    text = robot(url.format('base'), url.format('hip'))
    write(folder / NAME, 'visuals/base.dae', 'visuals/hip.dae')
    shutil.copytree(folder / NAME, folder / 'my_dog')
    made = write(folder / 'my_dog', text=text, manifest='my_dog')
    for name in ('base', 'hip'):
        mesh = folder / f'my_dog/visuals/{name}.dae'
        mesh.write_bytes((share_directory(NAME) / f'visuals/{name}.dae').read_bytes())
    return made


def copied_renamed_and_mesh_renamed(folder: Path) -> Path:
    return write(folder / 'my_dog', 'dae/trunk.obj', 'dae/hip.obj', manifest='my_dog')


def copied_out_of_the_installation(folder: Path) -> Path:
    # Each URL is right for the installed package; the copy's trunk was renamed.
    url = f'package://example-robot-data/robots/{NAME}/visuals/{{}}.dae'
    made = write(folder / NAME, text=robot(url.format('base'), url.format('hip')), manifest='')
    (folder / NAME / 'visuals').mkdir()
    for name, new in (('base', 'trunk'), ('hip', 'hip')):
        mesh = share_directory(NAME) / f'visuals/{name}.dae'
        shutil.copy(mesh, folder / NAME / f'visuals/{new}.dae')
    return made


def without_a_manifest(folder: Path) -> Path:
    return write(folder / 'dog', 'dae/trunk.obj', 'dae/hip.obj', manifest='')


def beside_the_file(folder: Path) -> Path:
    made = write(folder / 'x', 'dae/trunk.obj', 'dae/hip.obj', manifest='')
    flat = folder / 'flat'
    flat.mkdir()
    for path in (made, folder / 'x/dae/trunk.obj', folder / 'x/dae/hip.obj'):
        path.rename(flat / path.name)
    shutil.rmtree(folder / 'x')
    return flat / made.name


def relative_paths(folder: Path) -> Path:
    text = robot('../dae/base.obj', '../dae/hip.obj')
    return write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj', text=text)


def file_paths(folder: Path) -> Path:
    dae = f'file://{folder}/{NAME}/dae'
    text = robot(f'{dae}/base.obj', f'{dae}/hip.obj')
    return write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj', text=text)


def paths_of_another_machine(folder: Path) -> Path:
    dae = f'/home/somebody/ws/src/{NAME}/dae'
    text = robot(f'{dae}/base.obj', f'file://{dae}/hip.obj')
    return write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj', text=text)


def another_case(folder: Path) -> Path:
    return write(folder / NAME, 'dae/Base.OBJ', 'Dae/HIP.obj')


def another_extension(folder: Path) -> Path:
    url = f'package://{NAME}/dae/{{}}.dae'
    text = robot(url.format('base'), url.format('hip'))
    return write(folder / NAME, 'dae/base.obj', 'dae/hip.obj', text=text)


def through_find(folder: Path) -> Path:
    dae = f'file://$(find {NAME})/dae'
    text = robot(f'{dae}/base.obj', f'{dae}/hip.obj')
    path = write(folder / NAME, 'dae/trunk.obj', 'dae/hip.obj', text=text)
    return path.rename(path.with_suffix('.xacro'))


LAYOUTS = [
    renamed_beside,
    in_another_folder,
    renamed_in_another_folder,
    as_the_installed_one_has_it,
    linked_package,
    linked_description,
    copied_and_renamed,
    copied_renamed_and_mesh_renamed,
    copied_out_of_the_installation,
    without_a_manifest,
    beside_the_file,
    relative_paths,
    file_paths,
    paths_of_another_machine,
    another_case,
    another_extension,
    through_find,
]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))


def is_installed(path: Path) -> bool:
    return any(path.is_relative_to(folder) for folder in installed_folders())


@pytest.mark.parametrize('layout', LAYOUTS, ids=lambda layout: layout.__name__)
def test_the_own_mesh_is_used_and_said_and_the_fix_works_anywhere(
    layout: Callable[[Path], Path], tmp_path, caplog
):
    path = layout(tmp_path / 'here')
    with caplog.at_level(logging.WARNING):
        loaded = load_robot(str(path))
    assert len(loaded.meshes.files) == 2
    for url, file in loaded.meshes.files.items():
        assert file.is_relative_to(tmp_path)
        assert ('base' in url) == (file.stem.lower() in ('base', 'trunk'))
    said = [line for line in caplog.messages if 'using' in line]
    assert said
    for line in said:
        assert any(f'using {file} (' in line for file in loaded.meshes.files.values())
    for one in lint(XacroSession(path)):
        assert 'site-packages' not in one.line()
    (tmp_path / 'there').mkdir()
    written = write_mended(mend(path), path, tmp_path / 'there')
    shutil.rmtree(tmp_path / 'here')
    again = load_robot(str(written), strict=True)
    assert all(file.is_relative_to(tmp_path / 'there') for file in again.meshes.files.values())
    assert [one.line() for one in lint(XacroSession(written)) if 'mesh' in one.rule.code] == []
    assert main(['fix', str(written)]) == 0


def test_what_is_only_installed_here_is_used_and_said_and_no_cure_leads_there(tmp_path):
    path = write(tmp_path / NAME, text=robot(f'package://{NAME}/dae/base.dae', '../dae/hip.obj'))
    record = load_robot(str(path)).meshes.records[0]
    assert record.file == share_directory(NAME) / 'visuals/base.dae'
    assert 'of another package of that name' in record.line()
    assert str(record.file) in record.line()
    (one,) = [one for one in lint(XacroSession(path)) if one.rule.code == 'wrong-mesh-path']
    assert 'copy the file' in one.cure
    assert mend(path).after == {}
