# SPDX-License-Identifier: Apache-2.0
"""The one wheel: it is made of all packages, of a new one too, and holds all that they have."""

from collections.abc import Iterator
import configparser
from fnmatch import fnmatch
import importlib.util
from pathlib import Path
import re
import shutil
import subprocess
import sys
import zipfile

from cases import for_all
from executables import SCRIPTS
import pytest
from source_trees import ALSO_IN, data_files, modules, PACKAGES, ROOT

pytestmark = pytest.mark.slow


def build_wheel(root: Path, folder: Path) -> zipfile.ZipFile:
    """Return the wheel of a checkout, built into a folder."""
    if importlib.util.find_spec('hatchling') is None:
        pytest.skip('hatchling is not installed')
    command = [sys.executable, '-m', 'hatchling', 'build', '-t', 'wheel', '-d', str(folder)]
    subprocess.run(command, cwd=root, check=True, capture_output=True, text=True)
    (path,) = folder.glob('*.whl')
    return zipfile.ZipFile(path)


@pytest.fixture(scope='module')
def wheel(tmp_path_factory) -> Iterator[zipfile.ZipFile]:
    """The wheel, built from the checkout."""
    with build_wheel(ROOT, tmp_path_factory.mktemp('wheel')) as opened:
        yield opened


@for_all('package', PACKAGES)
def test_the_wheel_holds_every_file_of_a_package(package, wheel):
    wanted = {path.relative_to(ROOT / package).as_posix() for path in modules(package).values()}
    wanted |= {f'{package}/{name}' for name in data_files(package)}
    tops = (package, *ALSO_IN.get(package, ()))
    held = {name for name in wheel.namelist() if name.partition('/')[0] in tops}
    assert held - {f'{top}/py.typed' for top in tops} == wanted - {f'{package}/py.typed'}
    assert {f'{top}/py.typed' for top in tops} <= held


@for_all('package', PACKAGES)
def test_the_wheel_makes_its_environment_an_ament_prefix(package, wheel):
    shared = {name.partition('.data/data/')[2] for name in wheel.namelist()}
    assert f'share/{package}/package.xml' in shared
    assert f'share/ament_index/resource_index/packages/{package}' in shared
    descriptions = {name for name in data_files(package) if fnmatch(name, 'urdf/*')}
    assert {f'share/{package}/{name}' for name in descriptions} <= shared
    for folder in ('config', 'foxglove', 'launch', 'rviz'):
        names = {path.name for path in (ROOT / package).glob(f'{folder}/*.*')}
        assert {f'share/{package}/{folder}/{name}' for name in names} <= shared


def test_the_wheel_holds_the_executables_and_nothing_foreign(wheel):
    (listed,) = (name for name in wheel.namelist() if name.endswith('entry_points.txt'))
    parser = configparser.ConfigParser()
    parser.read_string(wheel.read(listed).decode())
    # The distribution's own name starts the command, too: `uvx wasd-robots go2`.
    also = {'wasd-robots': SCRIPTS['wasd']}
    assert dict(parser['console_scripts']) == SCRIPTS | also
    tops = {name.partition('/')[0] for name in wheel.namelist()}
    assert {top for top in tops if not top.startswith('wasd_robots-')} == {*PACKAGES, 'wasd'}


def test_a_controller_of_another_kind_is_its_package_and_a_name_in_one_list(tmp_path):
    for name in ('pyproject.toml', 'hatch_build.py', 'LICENSE', 'README.md'):
        shutil.copy(ROOT / name, tmp_path)
    listed = tmp_path / 'pyproject.toml'
    listed.write_text(
        re.sub('dev-mode-dirs = .*', 'dev-mode-dirs = ["spin_sim"]', listed.read_text())
    )
    written = {
        'wasd_bringup/package.xml': '<package><version>1.0</version></package>',
        'spin_sim/package.xml': '<package/>',
        'spin_sim/setup.cfg': '[options.entry_points]\nconsole_scripts = spin = spin_sim.go:main',
        'spin_sim/resource/spin_sim': '',
        'spin_sim/config/spin.yaml': '',
        'spin_sim/spin_sim/__init__.py': '',
    }
    for name, text in written.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    wheel = build_wheel(tmp_path, tmp_path / 'dist')
    names = {name.partition('.data/data/')[2] or name for name in wheel.namelist()}
    assert {
        'spin_sim/__init__.py',
        'share/spin_sim/package.xml',
        'share/spin_sim/config/spin.yaml',
        'share/ament_index/resource_index/packages/spin_sim',
    } <= names
    assert wheel.read('wasd_robots-1.0.dist-info/entry_points.txt') == (
        b'[console_scripts]\nspin = spin_sim.go:main\n'
    )


def test_what_an_index_shows_has_no_relative_link(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith('dist-info/METADATA'))
    _, _, readme = wheel.read(name).decode().partition('\n\n')
    links = re.findall(r'\]\(([^)]*)\)', readme)
    assert len(links) > 10
    assert [link for link in links if not link.startswith('https://')] == []
    pictures = re.findall(r'!\[[^]]*\]\(([^)]*)\)', readme)
    assert [picture for picture in pictures if '/raw/' not in picture] == []
