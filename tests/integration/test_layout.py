# SPDX-License-Identifier: Apache-2.0
"""The rules that hold the packages together: layers, names, versions, manifests."""

import ast
import configparser
from fnmatch import fnmatch
import functools
import importlib.metadata
import importlib.util
from pathlib import Path
import re
import shlex
import subprocess
import sys
import textwrap
import tomllib
from xml.etree import ElementTree

from cases import for_all
from executables import SCRIPTS
import pytest
from source_trees import ALSO_IN, data_files, imports, modules, nodes, PACKAGES, PROJECT, ROOT

# What a package may import: arrows point down only, and the keyboard knows no simulation. One that
# does not stand here simulates or controls.
BELOW = {
    'wasd_core': set(),
    'robot_description': {'wasd_core'},
    'teleop_keyboard': {'wasd_core'},
    'quadruped_sim': {'policy_player', 'robot_description', 'wasd_core'},
    'unitree_bridge': {'mujoco_sim', 'quadruped_sim', 'robot_description', 'wasd_core'},
    'wasd_cockpit': {'mujoco_sim', 'wasd_core'},
    'wasd_navigation': {'wasd_core'},
}
CONTROLLER_BELOW = {'robot_description', 'wasd_core'}
TOP = 'wasd_bringup'
# The names that users rely on.
EXECUTABLES = {
    'teleop_keyboard': {'gamepad', 'key_publisher', 'keys_to_twist', 'teleop', 'twist_mux'},
    'robot_description': {'describe', 'state_publisher'},
    'mujoco_sim': {'simulator'},
    'diff_drive_sim': {'diff_drive_controller'},
    'quadruped_sim': {'leg_controller'},
    'policy_player': {'policy_player'},
    'unitree_bridge': {'unitree_bridge'},
    'wasd_navigation': {'guard', 'navigator'},
    'wasd_bringup': {'wasd'},
}
# Import name -> rosdep key where they differ; None: docs/install.md names the package for pip.
ROSDEP_KEYS = {
    'PIL': 'python3-pil',
    'collada': 'python3-collada',
    'daqp': None,
    'fast_simplification': None,
    'gymnasium': None,
    'mcap': None,
    'mujoco': 'python3-mujoco-pip',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'onnxruntime': None,
    'rich': 'python3-rich',
    'trimesh': 'python3-trimesh-pip',
    'yaml': 'python3-yaml',
}
# What only some want, by the name of the extra that brings it; rosdep installs none of it.
EXTRAS = {'cyclonedds': 'unitree'}
ROS_SUFFIXES = ('_msgs', '_srvs', '_interfaces')


@pytest.fixture(scope='module', autouse=True)
def _forget_syntax_trees():
    """Let half a million nodes go: later tests fork, and collect garbage."""
    yield
    nodes.cache_clear()


def roots(package: str) -> set[str]:
    """Return the top-level names from outside the standard library that a package imports."""
    found = {
        name.partition('.')[0] for path in modules(package).values() for name in imports(path)
    }
    return found - set(sys.stdlib_module_names) - {package, *ALSO_IN.get(package, ())}


def below(package: str) -> set[str]:
    """Return the packages that one may import."""
    return BELOW.get(package, set(PACKAGES) - {TOP} if package == TOP else CONTROLLER_BELOW)


@functools.cache
def ros_modules() -> set[str]:
    """Return the modules that may know ROS: those that match a pattern of pyproject.toml."""
    known = {name for package in PACKAGES for name in modules(package)}
    patterns = PROJECT['tool']['wasd']['ros_modules']
    return {name for name in known for pattern in patterns if fnmatch(name, pattern)}


def manifest(package: str) -> ElementTree.Element:
    """Return the root of a package's package.xml."""
    return ElementTree.parse(ROOT / package / 'package.xml').getroot()


def is_ros(name: str) -> bool:
    """Return whether a dotted name belongs to ROS: its client library, messages, services."""
    root = name.partition('.')[0]
    return root == 'rclpy' or root.endswith(ROS_SUFFIXES)


def leads_to_ros(name: str) -> bool:
    """Return whether an import reaches ROS, itself or through one of our modules that know it."""
    module = module_of(name)
    ours = imports(modules(module.partition('.')[0])[module]) if module in ros_modules() else ()
    return is_ros(name) or any(is_ros(below) for below in ours)


def module_of(name: str) -> str:
    """Return our module that an import of a dotted name enters, '' where it is none of ours."""
    paths = modules(name.partition('.')[0])
    parent = name.rpartition('.')[0]
    entered = (name, f'{name}.__init__', parent, f'{parent}.__init__')
    return next((module for module in entered if module in paths), '')


@functools.cache
def import_graph() -> dict[str, set[str]]:
    """Return which of our modules each of them imports anywhere: lazily and for types, too."""
    return {
        module: {module_of(name) for name in imports(path)} - {'', module}
        for package in PACKAGES
        for module, path in modules(package).items()
    }


def circles(graph: dict[str, set[str]]) -> set[str]:
    """Return the modules from which imports lead back to them, and those behind such."""
    left = dict(graph)
    while leaves := {module for module, below in left.items() if not below & set(left)}:
        left = {module: below for module, below in left.items() if module not in leaves}
    return set(left)


def test_the_wheel_is_made_of_all_packages():
    # The one list of packages: wheel, ament prefix, executables and mypy go by it or by folders.
    assert PROJECT['tool']['hatch']['build']['dev-mode-dirs'] == PACKAGES


def test_colcon_finds_no_other_packages():
    # It looks into no folder that is a package or has a COLCON_IGNORE.
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name[0] != '.']
    others = [
        path.relative_to(ROOT)
        for folder in folders
        for path in folder.rglob('*/package.xml')
        if path.parent != folder
    ]
    hidden = [
        path
        for path in others
        if any((ROOT / folder / 'COLCON_IGNORE').is_file() for folder in path.parents)
    ]
    assert [str(path) for path in others if path not in hidden] == []


@for_all('package', PACKAGES)
def test_logic_imports_no_ros(package):
    offences = [
        f'{module} imports {name}'
        for module, path in modules(package).items()
        if module not in ros_modules()
        for name in imports(path)
        if leads_to_ros(name)
    ]
    assert not offences


@pytest.mark.slow
@pytest.mark.parametrize(
    ('module', 'kept_out'),
    [
        ('teleop_keyboard.teleop_node', ('robot_description', 'mujoco', 'pinocchio')),
        ('quadruped_sim.leg_controller_node', ('mujoco', 'mujoco_sim')),
        ('diff_drive_sim.diff_drive_controller_node', ('mujoco', 'mujoco_sim')),
    ],
)
def test_a_node_loads_no_simulator_and_teleop_no_robot(module, kept_out):
    look = f'import sys, {module}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', look], check=True, capture_output=True, text=True)
    loaded = {name.partition('.')[0] for name in done.stdout.split()}
    assert loaded & set(kept_out) == set()


LOADED = """
import sys
import rclpy
import wasd_core.node
from std_msgs.msg import String
String.__import_type_support__()
print(String.__class__._TYPE_SUPPORT is not None, 'lark' in sys.modules)
from rosidl_generator_py import generate_py
print(callable(generate_py), 'lark' in sys.modules)
"""


@pytest.mark.slow
def test_what_makes_messages_of_their_text_is_loaded_when_it_is_asked_for():
    done = subprocess.run(
        [sys.executable, '-c', LOADED], check=True, capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ['True False', 'True True']


@for_all('pattern', PROJECT['tool']['wasd']['ros_modules'])
def test_modules_may_know_ros_only_where_some_do(pattern):
    paths = {name: path for package in PACKAGES for name, path in modules(package).items()}
    matching = [path for name, path in paths.items() if fnmatch(name, pattern)]
    assert any(leads_to_ros(name) for path in matching for name in imports(path))


@for_all('package', PACKAGES)
def test_no_package_imports_one_above_or_beside_it(package):
    assert roots(package) & set(PACKAGES) <= below(package)


def test_no_import_leads_back_to_its_module():
    assert circles(import_graph()) == set()


def test_a_circle_of_imports_would_be_found():
    graph = import_graph()
    assert 'wasd_bringup.run.robot' in graph['wasd_bringup.run.run']
    closed = graph | {'wasd_core.errors': {*graph['wasd_core.errors'], 'wasd_bringup.run.run'}}
    assert {'wasd_bringup.run.run', 'wasd_core.errors'} <= circles(closed)


@for_all('package', PACKAGES)
def test_the_manifest_names_what_is_imported_and_nothing_above(package):
    declared = {element.text for element in manifest(package).iter('exec_depend')}
    needed = {ROSDEP_KEYS.get(root, root) for root in roots(package) - set(EXTRAS)} - {None}
    assert needed <= declared
    assert declared & set(PACKAGES) <= below(package)


@pytest.mark.parametrize('name', EXTRAS)
def test_what_only_some_want_an_extra_brings_and_nobody_imports_at_the_start(name):
    extra = PROJECT['project']['optional-dependencies'][EXTRAS[name]]
    assert name in {re.split('[=<>]', word)[0] for word in extra}
    users = {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        if any(found.partition('.')[0] == name for found in imports(path))
    }
    assert users == {'unitree_bridge.dds'}
    others = [path for package in PACKAGES for path in modules(package).values()]
    at_start = [
        path
        for path in others
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ImportFrom) and node.module in users
    ]
    assert at_start == []


def jazzy_lines() -> list[str]:
    """Return the commands with which docs/install.md makes a ROS workspace."""
    text = (ROOT / 'docs/install.md').read_text()
    section = text.split('## In a ROS 2 Jazzy workspace\n')[1]
    (block, *_) = re.findall(r'(?:^    .*\n)+', section, re.MULTILINE)
    return textwrap.dedent(block).replace('\\\n', ' ').splitlines()


def words_after(command: str) -> list[str]:
    """Return the arguments of the one line in which a command of the documentation stands."""
    (line,) = (line for line in jazzy_lines() if line.startswith(command))
    return shlex.split(line.removeprefix(command))


def test_what_rosdep_does_not_install_the_documented_pip_line_does():
    asked = {re.split('[=<>]', word)[0]: word for word in words_after('pip install ')}
    left = {root for package in PACKAGES for root in roots(package)} - set(EXTRAS)
    left = {root for root in left if ROSDEP_KEYS.get(root, root) is None}
    skipped = set(words_after('rosdep install ')[-1].split())
    # Keys that rosdep would give to pip, as root and at any version: left to our line.
    assert skipped == {key for key in ROSDEP_KEYS.values() if str(key).endswith('-pip')}
    left |= {root for root, key in ROSDEP_KEYS.items() if key in skipped}
    assert left <= {name.replace('-', '_') for name in asked}
    # No other version than that of the wheels' home.
    lines = (ROOT / 'requirements/run.txt').read_text().splitlines()
    words = (line.split()[0] for line in lines if '==' in line)
    pinned = {word.partition('==')[0]: word for word in words}
    same = {name: word for name, word in asked.items() if name in pinned and '=' in word}
    assert same == {name: pinned[name] for name in same}
    assert {'mujoco', 'daqp', 'example-robot-data'} <= set(same)
    # The page says why of each.
    page = (ROOT / 'docs/install.md').read_text()
    (reasons,) = re.findall(r'rosdep has no keys for(.*?)\(`python3-', page, re.DOTALL)
    packages = {name for name in asked if not name.startswith('-')}
    assert packages <= set(re.findall(r'[\w-]+', reasons.lower()))


def test_all_packages_have_one_version_and_the_installed_one():
    versions = {package: manifest(package).findtext('version') for package in PACKAGES}
    assert len(set(versions.values())) == 1, versions
    try:
        installed = importlib.metadata.version('wasd-robots')
    except importlib.metadata.PackageNotFoundError:
        pytest.skip('the project is on the path but not installed')
    assert installed == versions['wasd_bringup']


@for_all('package', PACKAGES)
def test_the_manifest_names_its_folder_and_licence(package):
    assert manifest(package).findtext('name') == package
    assert manifest(package).findtext('license') == PROJECT['project']['license']
    assert (ROOT / package / 'resource' / package).is_file()


def test_pixi_installs_every_dependency_of_the_project() -> None:
    pixi = tomllib.loads((ROOT / 'pixi.toml').read_text())
    names = {
        'pin': 'pinocchio',
        'wasd-interfaces': 'ros-jazzy-nav2-msgs',
        'xacro': 'ros-jazzy-xacro',
    }
    wanted = [re.match('[a-z0-9-]+', each)[0] for each in PROJECT['project']['dependencies']]
    installed = pixi['dependencies'].keys() | pixi['pypi-dependencies'].keys()
    assert {names.get(name, name) for name in wanted} <= installed


@for_all('package', EXECUTABLES)
def test_a_package_has_the_executables_that_users_rely_on(package):
    targets = {name for name, target in SCRIPTS.items() if target.startswith(package + '.')}
    assert targets == EXECUTABLES[package]


@for_all('target', SCRIPTS.values())
def test_every_executable_leads_to_what_runs(target):
    module, function = target.split(':')
    tree = ast.parse(modules(module.partition('.')[0])[module].read_text())
    callables = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.value).startswith('Executable('):
            callables.add(ast.unparse(node.targets[0]))
    assert function in callables


@for_all('package', PACKAGES)
def test_colcon_installs_every_data_file(package):
    setup = configparser.ConfigParser()
    setup.read(ROOT / package / 'setup.cfg')
    patterns = setup['options.package_data']['*'].split(', ')
    folder = ROOT / package / package
    covered = {p.relative_to(folder).as_posix() for g in patterns for p in folder.glob(g)}
    assert data_files(package) - covered == set()


@for_all('package', PACKAGES)
def test_colcon_knows_the_marks_of_all_tests(package):
    setup = configparser.ConfigParser()
    setup.read(ROOT / package / 'setup.cfg')
    marks = setup['tool:pytest']['markers'].strip().split('\n')
    assert marks == PROJECT['tool']['pytest']['ini_options']['markers']


def python_files() -> list[Path]:
    """Return every Python file of the repository, tests included."""
    folders = [*PACKAGES, 'tests', 'benchmarks', 'docs']
    return [path for folder in folders for path in (ROOT / folder).rglob('*.py')]


def test_every_python_file_says_its_licence():
    spdx = '# SPDX-License-Identifier: Apache-2.0'
    texts = {path.relative_to(ROOT): path.read_text().splitlines() for path in python_files()}
    assert [str(path) for path, lines in texts.items() if spdx not in lines[:2]] == []


def test_what_a_controller_of_another_kind_may_import_follows_from_what_it_is():
    assert below('spin_sim') == {'robot_description', 'wasd_core'}
    patterns = PROJECT['tool']['wasd']['ros_modules']
    assert any(fnmatch('spin_sim.spin_node', pattern) for pattern in patterns)
