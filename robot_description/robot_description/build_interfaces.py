# SPDX-License-Identifier: Apache-2.0
"""
Builds and installs interfaces that are not among ROS' wheels, see PACKAGES.

`./wasd` runs this once, where no wheel of them came; by hand:
`python -m robot_description.build_interfaces`. With `--wheel DIR` it makes that wheel.
"""

import base64
from collections.abc import Callable, Sequence
import contextlib
import hashlib
import importlib
import importlib.metadata
import importlib.util
import io
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from typing import Any, NamedTuple
import zipfile

import numpy as np
from wasd_core.command_line import OneLineParser
from wasd_core.errors import UserError
from wasd_core.network import is_sourced


class Package(NamedTuple):
    """
    A row of PACKAGES: a package with interfaces, files in its folder of `interfaces`.

    What another of them is made of comes before it. `below` are the packages whose interfaces
    they are made of; without the package there is no `use`. `check` is Python that uses the
    interfaces and fails if that does not work.
    """

    name: str
    interfaces: tuple[str, ...]
    below: tuple[str, ...]
    use: str
    check: str

    @property
    def source(self) -> Path:
        """The folder with its interface and its manifest."""
        return Path(__file__).parent / 'interfaces' / self.name


PACKAGES = (
    Package(
        'tf2_msgs',
        ('msg/TFMessage.msg',),
        ('builtin_interfaces', 'geometry_msgs', 'std_msgs'),
        '/tf',
        """
from rclpy.serialization import deserialize_message, serialize_message
from tf2_msgs.msg import TFMessage
assert deserialize_message(serialize_message(TFMessage()), TFMessage) == TFMessage()
""",
    ),
    Package(
        'nav2_msgs',
        (
            'msg/MissedWaypoint.msg',
            'action/FollowWaypoints.action',
            'action/NavigateToPose.action',
        ),
        (
            'action_msgs',
            'builtin_interfaces',
            'geometry_msgs',
            'service_msgs',
            'std_msgs',
            'unique_identifier_msgs',
        ),
        'navigate_to_pose and follow_waypoints',
        """
from nav2_msgs.action import FollowWaypoints, NavigateToPose
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.type_support import check_for_type_support
for action in (FollowWaypoints, NavigateToPose):
    check_for_type_support(action)
    goal = action.Impl.SendGoalService.Request()
    assert deserialize_message(serialize_message(goal), type(goal)) == goal
""",
    ),
)
PREFIX = Path(sys.prefix)
HEADER = Path(sysconfig.get_path('include')) / 'Python.h'
# The newest symbols of a platform that ROS' own wheels are built for, as auditwheel has them.
MANYLINUX_2_28 = {'GLIBC': (2, 28), 'GLIBCXX': (3, 4, 24), 'CXXABI': (1, 3, 11)}
DESCRIPTION_TEXT = """The package `tf2_msgs` of ROS 2 Jazzy and of `nav2_msgs` the actions
`NavigateToPose` and `FollowWaypoints`, built by ROS' own generators for the wheels of rclpy. It
is a part of `wasd-robots`.
"""
# What rmw_fastrtps asks for: the first to (de)serialise, the second to describe the type.
TYPE_SUPPORTS = ['rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c']
DESCRIPTION = 'rosidl_generator_type_description'
# The generator whose output becomes the Python package, and the module that registers it.
PYTHON = 'rosidl_generator_py'
# Libraries by the generator of their sources; later ones use those before.
LIBRARIES = {
    'rosidl_generator_c': '*/detail/*.c',
    'rosidl_typesupport_fastrtps_c': '*/detail/*.cpp',
    'rosidl_typesupport_introspection_c': '*/detail/*.c',
    'rosidl_typesupport_c': '*/*.cpp',
    PYTHON: '*/_*_s.c',
}
RUNTIME = (
    'fastcdr',
    'rcutils',
    'rosidl_runtime_c',
    'rosidl_typesupport_c',
    'rosidl_typesupport_fastrtps_c',
    'rosidl_typesupport_fastrtps_cpp',
    'rosidl_typesupport_introspection_c',
)
# The wheel with all packages; raise the version when one of them changes.
DISTRIBUTION, VERSION = 'wasd-interfaces', '0.1.1'
# What the installed package was made of; also the mark that it is ours.
STAMP = 'made_of.txt'


class Place(NamedTuple):
    """Where packages are installed: the prefix of libraries and index entries, and the code."""

    prefix: Path
    site: Path


HERE = Place(PREFIX, Path(sysconfig.get_path('purelib')))


class CannotBuild(UserError):
    """An interface cannot be built here; says what is missing and what helps."""


def find_compiler() -> str:
    """
    Return the C++ compiler, which also takes C: $CXX or the first of the usual names.

    Raises:
        CannotBuild: there is none, or Python's headers are missing, or ROS is not from wheels.
    """
    if not (PREFIX / 'share' / PYTHON / 'resource').is_dir():
        raise CannotBuild(f'no wheels of ROS in {PREFIX}')
    names = [os.environ.get('CXX', ''), 'g++', 'c++', 'clang++']
    compiler = next(filter(None, map(shutil.which, filter(None, names))), None)
    missing = ['no C++ compiler'] * (compiler is None) + [f'no {HEADER}'] * (not HEADER.is_file())
    if missing or compiler is None:
        raise CannotBuild(f'{", ".join(missing)}: sudo apt install g++ python3-dev')
    return compiler


def generate(package: Package, made: Path) -> None:
    """Write each generator's output into `made/GENERATOR/PYTHON`, as rosidl's cmake does."""
    name, sources = package.name, list(map(Path, package.interfaces))
    interfaces = [source.with_suffix('').as_posix() for source in sources]
    idl = made / 'idl' / name
    for source in sources:
        kind = source.suffix[1:]
        convert = (f'rosidl_adapter.{kind}', f'convert_{kind}_to_idl')
        _call(*convert, package.source, name, source, idl / kind)

    def run(generator: str, function: str, *arguments: Any, **settings: Any) -> None:
        templates, output = PREFIX / 'share' / generator / 'resource', made / generator / name
        settings |= {
            'package_name': name,
            'idl_tuples': [f'{idl}:{interface}.idl' for interface in interfaces],
            'target_dependencies': [__file__],
            'template_dir': str(templates),
            'output_dir': str(output),
        }
        path = made / f'{generator}.json'
        path.write_text(json.dumps(settings))
        _call(generator, function, str(path), *arguments)
        header = f'{generator}__visibility_control.h'
        if (templates / f'{header}.in').is_file():
            text = (templates / f'{header}.in').read_text()
            text = text.replace('@PROJECT_NAME_UPPER@', name.upper())
            # Where the others look for it, whatever kind of interface there is.
            (output / 'msg').mkdir(exist_ok=True)
            (output / 'msg' / header).write_text(text.replace('@PROJECT_NAME@', name))

    shares = [f'{below}:{PREFIX / "share" / below}' for below in package.below]
    run(DESCRIPTION, 'generate_type_hash', include_paths=shares)
    run(
        'rosidl_generator_c',
        'generate_c',
        type_description_tuples=[
            f'{interface}.idl:{made / DESCRIPTION / name / interface}.json'
            for interface in interfaces
        ],
        ros_interface_files=[str(package.source / source) for source in sources],
    )
    run('rosidl_typesupport_fastrtps_c', 'generate_typesupport_fastrtps_c')
    run('rosidl_typesupport_introspection_c', 'generate_c')
    run('rosidl_typesupport_c', 'generate_c', TYPE_SUPPORTS)
    run(PYTHON, 'generate_py', ['rosidl_typesupport_c'])
    (made / PYTHON / name / '__init__.py').touch()


def _call(module: str, function: str, *arguments: Any) -> None:
    """
    Call a generator's function; what it says is for no user.

    Raises:
        CannotBuild: it is not there, or failed in any of its ways.
    """
    try:
        called: Callable[..., Any] = getattr(importlib.import_module(module), function)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            called(*arguments)
    except Exception as error:
        raise CannotBuild(f'{module}.{function}: {type(error).__name__}: {error}') from error


def compile_libraries(package: Package, made: Path, compiler: str) -> None:
    """
    Compile what was generated to libraries in `made/lib` and to the package's extension.

    Raises:
        CannotBuild: with the compiler's first complaint.
    """
    name, libraries = package.name, made / 'lib'
    libraries.mkdir()
    includes = [*(made / kind for kind in LIBRARIES), *sorted((PREFIX / 'include').iterdir())]
    includes += [PREFIX / 'include', HEADER.parent, Path(np.get_include())]
    common = [compiler, '-O1', '-fPIC', '-shared', *(f'-I{folder}' for folder in includes)]
    links = [f'-l{library}' for library in RUNTIME]
    links += [f'-l{below}__{kind}' for below in package.below for kind in LIBRARIES]
    links += [f'-L{libraries}', f'-L{PREFIX / "lib"}', f'-Wl,-rpath-link,{PREFIX / "lib"}']
    done: list[str] = []

    def link(target: Path, sources: list[Path], run_path: str) -> None:
        origin = [f'-Wl,-rpath,{run_path}', f'-Wl,-soname,{target.name}', '-Wl,--as-needed']
        # A C++ compiler takes a .c for C++ unless told, of each file anew.
        language = 'c' if sources[0].suffix == '.c' else 'c++'
        paths = [word for source in sources for word in ('-x', language, str(source))]
        command = [*common, *paths, '-o', str(target), *origin, *done, *links]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode:
            said = result.stderr.splitlines() or ['it does not say why']
            why = next((line for line in said if 'error' in line), said[0])
            raise CannotBuild(f'{compiler} failed at {target.name}: {why}')

    for generator, pattern in LIBRARIES.items():
        sources = sorted((made / generator / name).glob(pattern))
        link(libraries / f'lib{name}__{generator}.so', sources, '$ORIGIN')
        done.append(f'-l{name}__{generator}')
    code = made / PYTHON / name
    extension = [code / f'_{name}_s.ep.rosidl_typesupport_c.c']
    link(code / f'{name}_s__rosidl_typesupport_c.so', extension, '$ORIGIN/../../..')


def fingerprint(package: Package) -> str:
    """Return what a build depends on: recipe, interface, Python and the wheels' versions."""
    recipe = [Path(__file__), *sorted(package.source.rglob('*.*'))]
    digest = hashlib.sha256(b''.join(path.read_bytes() for path in recipe))
    wheels = sorted(
        f'{found.name} {found.version}'
        for found in importlib.metadata.distributions()
        if found.name.startswith('ros-')
    )
    return '\n'.join([digest.hexdigest(), str(sys.implementation.cache_tag), *wheels, ''])


def state(package: Package) -> str:
    """Return `current`, `stale` or `missing`; `foreign` when the package is somebody else's."""
    stamp = HERE.site / package.name / STAMP
    if stamp.is_file():
        return 'current' if stamp.read_text() == fingerprint(package) else 'stale'
    return 'foreign' if is_importable(package.name) else 'missing'


def is_importable(name: str) -> bool:
    """Whether some package of this name is found: that of a sourced ROS, mostly."""
    return importlib.util.find_spec(name) is not None


def build(package: Package, place: Place) -> None:
    """
    Make a package and install it into an environment; until it is complete none is there.

    Raises:
        CannotBuild: no compiler, no headers, or no wheels to build against.
    """
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(prefix=f'{package.name}-') as folder:
        made = Path(folder)
        generate(package, made)
        compile_libraries(package, made, compiler)
        check(package, made)
        install(package, made, place)


def check(package: Package, made: Path) -> None:
    """
    Use the package that was made, in a process of its own.

    Raises:
        CannotBuild: with the last line of what went wrong.
    """
    libraries = [str(made / 'lib'), os.environ.get('LD_LIBRARY_PATH', '')]
    environment = {
        **os.environ,
        'PYTHONPATH': str(made / PYTHON),
        'LD_LIBRARY_PATH': os.pathsep.join(filter(None, libraries)),
    }
    command = [sys.executable, '-P', '-c', package.check]
    result = subprocess.run(command, env=environment, capture_output=True, text=True)
    if result.returncode:
        why = (result.stderr.splitlines() or [f'status {result.returncode}'])[-1]
        raise CannotBuild(f'the built package does not work: {why}')


def install(package: Package, made: Path, place: Place) -> None:
    """Put libraries, interface files and index entries into place, and the package last."""
    name, sources = package.name, list(map(Path, package.interfaces))
    code, arriving = place.site / name, place.site / f'.{name}.new'
    shutil.rmtree(code, ignore_errors=True)
    for path in (made / 'lib').iterdir():
        _put(path, place.prefix / 'lib' / path.name)
    share = place.prefix / 'share' / name
    index = place.prefix / 'share/ament_index/resource_index'
    _put(package.source / 'package.xml', share / 'package.xml')
    for folder in (package.source, made / 'idl' / name, made / DESCRIPTION / name):
        for source in sources:
            for path in folder.glob(f'{source.with_suffix("")}.*'):
                _put(path, share / source.parent / path.name)
    for kind in ('packages', 'rosidl_interfaces'):
        (index / kind).mkdir(parents=True, exist_ok=True)
    (index / 'packages' / name).touch()
    listed = [f'{source.with_suffix(".idl")}\n{source}\n' for source in sources]
    (index / 'rosidl_interfaces' / name).write_text(''.join(listed))
    shutil.rmtree(arriving, ignore_errors=True)
    shutil.copytree(made / PYTHON / name, arriving, ignore=shutil.ignore_patterns('*.c'))
    (arriving / STAMP).write_text(fingerprint(package))
    arriving.rename(code)


def _put(path: Path, target: Path) -> None:
    """Copy a file so that nobody who has it open, or stops us, sees half of it."""
    target.parent.mkdir(parents=True, exist_ok=True)
    arriving = target.with_name(f'.{target.name}.new')
    shutil.copy(path, arriving)
    arriving.replace(target)


def make_wheel(folder: Path) -> Path:
    """
    Build all packages for this Python, and return the wheel of them in a folder.

    Raises:
        CannotBuild: no compiler, no headers, or no wheels to build against.
    """
    with tempfile.TemporaryDirectory(prefix='wheel-') as name:
        tree = Path(name)
        data = tree / f'{_file_name()}.data/data'
        for package in PACKAGES:
            build(package, Place(data, tree))
        tag = f'{_python_tag()}-{_platform_tag(tree)}'
        facts = tree / f'{_file_name()}.dist-info'
        facts.mkdir()
        (facts / 'METADATA').write_text(_metadata())
        kind = f'Generator: {Path(__file__).stem}\nRoot-Is-Purelib: false\nTag: {tag}'
        (facts / 'WHEEL').write_text(f'Wheel-Version: 1.0\n{kind}\n')
        record(tree, facts, _files(tree))
        path = folder / f'{_file_name()}-{tag}.whl'
        folder.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as wheel:
            for file in _files(tree):
                # Of the same time always, so that equal contents make equal wheels.
                entry = zipfile.ZipInfo(file.relative_to(tree).as_posix())
                entry.external_attr = (0o755 if file.suffix == '.so' else 0o644) << 16
                entry.compress_type = zipfile.ZIP_DEFLATED
                wheel.writestr(entry, file.read_bytes())
        return path


def register(place: Place) -> None:
    """Tell pip that the packages are there, and which files they are."""
    facts = place.site / f'{_file_name()}.dist-info'
    facts.mkdir(exist_ok=True)
    (facts / 'METADATA').write_text(_metadata())
    (facts / 'INSTALLER').write_text('wasd\n')
    files: list[Path] = []
    for package in PACKAGES:
        files += _files(place.site / package.name) + _files(place.prefix / 'share' / package.name)
        files += sorted((place.prefix / 'lib').glob(f'lib{package.name}__*.so'))
        index = place.prefix / 'share/ament_index/resource_index'
        files += sorted(index.glob(f'*/{package.name}'))
    record(place.site, facts, files)


def record(root: Path, facts: Path, files: Sequence[Path]) -> None:
    """Write the list of files, and of those that say so, by their paths from a folder."""
    listed = facts / 'RECORD'
    listed.touch()
    lines = []
    for file in dict.fromkeys((*files, *_files(facts))):
        name = Path(os.path.relpath(file, root)).as_posix()
        digest = base64.urlsafe_b64encode(hashlib.sha256(file.read_bytes()).digest())
        row = f'sha256={digest.decode().rstrip("=")},{file.stat().st_size}'
        lines.append(f'{name},{"," if file == listed else row}\n')
    listed.write_text(''.join(lines))


def _files(folder: Path) -> list[Path]:
    found = (path for path in folder.rglob('*') if path.is_file())
    return sorted(path for path in found if '__pycache__' not in path.parts)


def _file_name() -> str:
    return f'{DISTRIBUTION.replace("-", "_")}-{VERSION}'


def _python_tag() -> str:
    version = f'cp{sys.version_info.major}{sys.version_info.minor}'
    return f'{version}-{version}'


def _platform_tag(tree: Path) -> str:
    """Return the oldest platform of ROS' own wheels if what was built runs there."""
    machine = sysconfig.get_platform().replace('-', '_').replace('.', '_')
    text = b''.join(path.read_bytes() for path in tree.rglob('*.so'))
    for symbol, newest in MANYLINUX_2_28.items():
        for version in re.findall(rb'\b%s_([0-9.]+)' % symbol.encode(), text):
            if tuple(map(int, version.split(b'.'))) > newest:
                return machine
    return machine.replace('linux_', 'manylinux_2_28_')


def _metadata() -> str:
    """Return what a package index and pip are told."""
    minor = f'{sys.version_info.major}.{sys.version_info.minor}'
    names = sorted({f'ros-{name.replace("_", "-")}' for each in PACKAGES for name in each.below})
    needs = [(name, importlib.metadata.version(name)) for name in names]
    lines = [
        'Metadata-Version: 2.4',
        f'Name: {DISTRIBUTION}',
        f'Version: {VERSION}',
        'Summary: tf2_msgs and two actions of nav2_msgs, built for the wheels of ROS 2 Jazzy',
        'Author: the wasd contributors',
        'License-Expression: Apache-2.0',
        'Classifier: Operating System :: POSIX :: Linux',
        f'Classifier: Programming Language :: Python :: {minor}',
        f'Requires-Python: =={minor}.*',
        # Interfaces do not change within a distribution of ROS.
        *(f'Requires-Dist: {name}~={version}' for name, version in needs),
        'Description-Content-Type: text/markdown',
        '',
        DESCRIPTION_TEXT,
    ]
    return '\n'.join(lines)


def main(words: Sequence[str] = ()) -> int:
    """Build the packages that are missing or stale, or their wheel; return the exit status."""
    parser = OneLineParser(prog=f'python -m robot_description.{Path(__file__).stem}')
    parser.add_argument('--wheel', type=Path, metavar='DIR', help='make a wheel of them in DIR')
    folder = parser.parse_args(words).wheel
    if folder is not None:
        try:
            print(make_wheel(folder))
        except (UserError, OSError) as error:
            print(f'error: {error}', file=sys.stderr)
            return 2
        return 0
    return _build_missing()


def _build_missing() -> int:
    left = list(PACKAGES)
    while left:
        package = left[0]
        started = time.monotonic()
        try:
            if state(package) in ('current', 'foreign'):
                print(f'{package.name} is there')
            else:
                build(package, HERE)
                print(f'{package.name} built in {time.monotonic() - started:.1f} s')
        except (UserError, OSError) as error:
            # What keeps one from being built keeps those after it, too.
            lacks = [other for other in left if state(other) in ('stale', 'missing')]
            _say_missing(lacks, error)
            return 2
        del left[0]
    if all(state(package) == 'current' for package in PACKAGES):
        register(HERE)
    return 0


def _say_missing(packages: list[Package], error: Exception) -> None:
    """Say in one line what is not there, why, and what helps."""
    missing = '; '.join(f'no {package.name}, so no {package.use}' for package in packages)
    cure = f'then: {sys.executable} -m robot_description.{Path(__file__).stem}'
    if is_sourced(os.environ):
        names = [package.name.replace('_', '-') for package in packages]
        distribution = os.environ['ROS_DISTRO']
        cure = f'sudo apt install {" ".join(f"ros-{distribution}-{name}" for name in names)}'
    print(f'error: {missing}: {error}; {cure}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
