# SPDX-License-Identifier: Apache-2.0
"""Where example-robot-data is found, however it was installed."""

from pathlib import Path
import subprocess
import sys

from cases import for_all
import pytest
from robot_description.packages import EXAMPLE_ROBOT_DATA, OWN_PACKAGE, share_directory
from robot_description.xacro.session import expand_document
from source_trees import PACKAGES, ROOT
from wasd_core.errors import DescriptionError, PackageNotFound


def make_wheel(site: Path) -> Path:
    """Lay out what the wheel of example-robot-data puts into a site folder."""
    share = site / 'cmeel.prefix/share' / EXAMPLE_ROBOT_DATA
    (share / 'robots/go2_description').mkdir(parents=True)
    return share


@pytest.fixture
def elsewhere(monkeypatch):
    """No example-robot-data in this Python's own folders, nor in an ament prefix."""
    monkeypatch.setattr(sys, 'path', [p for p in sys.path if 'site-packages' not in p])
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)


def test_a_wheel_is_found_in_any_folder_that_python_imports_from(elsewhere, tmp_path, monkeypatch):
    with pytest.raises(PackageNotFound):
        share_directory(EXAMPLE_ROBOT_DATA)
    share = make_wheel(tmp_path)
    monkeypatch.setattr(sys, 'path', [str(tmp_path), *sys.path])
    assert share_directory(EXAMPLE_ROBOT_DATA) == share
    assert share_directory('go2_description') == share / 'robots/go2_description'


@pytest.mark.slow
def test_a_wheel_is_found_after_pip_install_user(tmp_path):
    ask = 'import site; print(site.getusersitepackages())'
    find = (
        'import sys; sys.path[:0] = sys.argv[1:]\n'
        'from robot_description.packages import share_directory as find\n'
        f'print(find({EXAMPLE_ROBOT_DATA!r}))'
    )
    root = Path(__file__).parents[2]
    sources = [str(root / name) for name in ('robot_description', 'wasd_core')]
    # The Python below this environment: it has a user's folder, and nothing of ours.
    python = str(Path(sys.base_prefix, 'bin', f'python{sys.version_info[0]}'))
    world = {'HOME': str(tmp_path), 'PATH': '/usr/bin:/bin'}

    def run(*words: str) -> str:
        done = subprocess.run([python, '-c', *words], env=world, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    share = make_wheel(Path(run(ask)))
    assert run(find, *sources) == str(share)


@for_all('package', PACKAGES)
def test_each_of_our_packages_is_found_where_its_shared_files_are(package):
    found = share_directory(package)
    if package == OWN_PACKAGE:
        assert (found / 'urdf/go2/go2.urdf.xacro').is_file()
        return
    assert (found / 'package.xml').read_bytes() == (ROOT / package / 'package.xml').read_bytes()
    for folder in ('config', 'foxglove', 'launch', 'rviz'):
        for path in (ROOT / package / folder).rglob('*.*'):
            if '__pycache__' not in path.parts:
                shared = found / path.relative_to(ROOT / package)
                assert shared.read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_a_clone_is_read_where_its_installation_leaves_folders_out(tmp_path):
    # As CMake installs `description/urdf` and `description/parts` of a package.
    robot, parts = tmp_path / 'demo/description/urdf', tmp_path / 'demo/description/parts'
    shared = tmp_path / 'demo_shared/box'
    for folder in (robot, parts, shared):
        folder.mkdir(parents=True)
    for name in ('demo', 'demo_shared'):
        (tmp_path / name / 'package.xml').write_text(f'<package><name>{name}_1</name></package>')
    head = '<robot name="demo" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    (parts / 'lid.xacro').write_text(f'{head}<link name="lid"/></robot>')
    (shared / 'box.xacro').write_text(f'{head}<link name="box"/></robot>')
    path = robot / 'demo.xacro'
    path.write_text(
        f'{head}<xacro:include filename="$(find demo_1)/parts/lid.xacro"/>'
        '<xacro:include filename="$(find demo_shared_1)/box/box.xacro"/></robot>'
    )
    expansion = expand_document(path)
    assert [attributes['name'] for _, attributes, *_ in expansion.nodes[1:]] == ['lid', 'box']
    ((_, text),) = expansion.warnings
    assert f'is not there, using {parts}/lid.xacro, which is installed so' in text
    (tmp_path / 'demo/other/parts').mkdir(parents=True)
    (tmp_path / 'demo/other/parts/lid.xacro').write_text(f'{head}</robot>')
    with pytest.raises(DescriptionError, match='parts/lid.xacro: no such file'):
        expand_document(path)
