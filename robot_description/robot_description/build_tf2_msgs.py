# SPDX-License-Identifier: Apache-2.0
"""
Builds and installs tf2_msgs, which is not among ROS' wheels: `/tf` and `/tf_static` need it.

`./wasd` runs this once; by hand: `python -m robot_description.build_tf2_msgs`.
"""

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
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from typing import Any

import numpy as np
from wasd_core.errors import UserError

NAME = 'tf2_msgs'
SOURCE = Path(__file__).parent / 'interfaces' / NAME
MESSAGE = 'msg/TFMessage'
PREFIX = Path(sys.prefix)
HEADER = Path(sysconfig.get_path('include')) / 'Python.h'
# Packages whose messages TFMessage is made of.
BELOW = ('builtin_interfaces', 'geometry_msgs', 'std_msgs')
# What rmw_fastrtps asks for: the first to (de)serialise, the second to describe the type.
TYPE_SUPPORTS = ['rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c']
DESCRIPTION = 'rosidl_generator_type_description'
# The generator whose output becomes the Python package, and the module that registers it.
PACKAGE = 'rosidl_generator_py'
EXTENSION = f'{NAME}_s__rosidl_typesupport_c.so'
EXTENSION_SOURCE = f'_{NAME}_s.ep.rosidl_typesupport_c.c'
# Libraries by the generator of their sources; later ones use those before.
LIBRARIES = {
    'rosidl_generator_c': (
        'msg/detail/tf_message__description.c',
        'msg/detail/tf_message__functions.c',
        'msg/detail/tf_message__type_support.c',
    ),
    'rosidl_typesupport_fastrtps_c': ('msg/detail/tf_message__type_support_c.cpp',),
    'rosidl_typesupport_introspection_c': ('msg/detail/tf_message__type_support.c',),
    'rosidl_typesupport_c': ('msg/tf_message__type_support.cpp',),
    PACKAGE: ('msg/_tf_message_s.c',),
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
# Where the package is installed: libraries and index entries, and the Python code.
TARGET = PREFIX
SITE_PACKAGES = Path(sysconfig.get_path('purelib'))
# What the installed package was made of; also the mark that it is ours.
STAMP = 'made_of.txt'
CHECK = """
from rclpy.serialization import deserialize_message, serialize_message
from tf2_msgs.msg import TFMessage
assert deserialize_message(serialize_message(TFMessage()), TFMessage) == TFMessage()
"""


class CannotBuild(UserError):
    """tf2_msgs cannot be built here; says what is missing and what helps."""


def find_compiler() -> str:
    """
    Return the C++ compiler, which also takes C: $CXX or the first of the usual names.

    Raises:
        CannotBuild: there is none, or Python's headers are missing, or ROS is not from wheels.
    """
    if not (PREFIX / 'share' / PACKAGE / 'resource').is_dir():
        raise CannotBuild(f'no wheels of ROS in {PREFIX}: source a ROS that has {NAME}')
    names = [os.environ.get('CXX', ''), 'g++', 'c++', 'clang++']
    compiler = next(filter(None, map(shutil.which, filter(None, names))), None)
    missing = ['no C++ compiler'] * (compiler is None) + [f'no {HEADER}'] * (not HEADER.is_file())
    if missing or compiler is None:
        raise CannotBuild(f'{", ".join(missing)}: sudo apt install g++ python3-dev')
    return compiler


def generate(made: Path) -> None:
    """Write each generator's output into `made/GENERATOR/tf2_msgs`, as rosidl's cmake does."""
    idl = made / 'idl' / NAME
    source = Path(f'{MESSAGE}.msg')
    _call('rosidl_adapter.msg', 'convert_msg_to_idl', SOURCE, NAME, source, idl / 'msg')

    def run(generator: str, function: str, *arguments: Any, **settings: Any) -> None:
        templates, output = PREFIX / 'share' / generator / 'resource', made / generator / NAME
        settings |= {
            'package_name': NAME,
            'idl_tuples': [f'{idl}:{MESSAGE}.idl'],
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
            text = text.replace('@PROJECT_NAME_UPPER@', NAME.upper())
            (output / 'msg' / header).write_text(text.replace('@PROJECT_NAME@', NAME))

    shares = [f'{name}:{PREFIX / "share" / name}' for name in BELOW]
    run(DESCRIPTION, 'generate_type_hash', include_paths=shares)
    run(
        'rosidl_generator_c',
        'generate_c',
        type_description_tuples=[f'{MESSAGE}.idl:{made / DESCRIPTION / NAME / MESSAGE}.json'],
        ros_interface_files=[str(SOURCE / source)],
    )
    run('rosidl_typesupport_fastrtps_c', 'generate_typesupport_fastrtps_c')
    run('rosidl_typesupport_introspection_c', 'generate_c')
    run('rosidl_typesupport_c', 'generate_c', TYPE_SUPPORTS)
    run(PACKAGE, 'generate_py', ['rosidl_typesupport_c'])
    (made / PACKAGE / NAME / '__init__.py').touch()


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


def compile_libraries(made: Path, compiler: str) -> None:
    """
    Compile what was generated to libraries in `made/lib` and to the package's extension.

    Raises:
        CannotBuild: with the compiler's first complaint.
    """
    libraries = made / 'lib'
    libraries.mkdir()
    includes = [*(made / kind for kind in LIBRARIES), *sorted((PREFIX / 'include').iterdir())]
    includes += [PREFIX / 'include', HEADER.parent, Path(np.get_include())]
    common = [compiler, '-O2', '-fPIC', '-shared', *(f'-I{folder}' for folder in includes)]
    links = [f'-l{name}' for name in RUNTIME]
    links += [f'-l{name}__{kind}' for name in BELOW for kind in LIBRARIES]
    links += [f'-L{libraries}', f'-L{PREFIX / "lib"}', f'-Wl,-rpath-link,{PREFIX / "lib"}']
    done: list[str] = []

    def link(target: Path, generator: str, sources: Sequence[str], run_path: str) -> None:
        origin = [f'-Wl,-rpath,{run_path}', f'-Wl,-soname,{target.name}', '-Wl,--as-needed']
        # A C++ compiler takes a .c for C++ unless told.
        language = 'c' if sources[0].endswith('.c') else 'c++'
        paths = [str(made / generator / NAME / name) for name in sources]
        command = [*common, '-x', language, *paths, '-o', str(target), *origin, *done, *links]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode:
            said = result.stderr.splitlines() or ['it does not say why']
            why = next((line for line in said if 'error' in line), said[0])
            raise CannotBuild(f'{compiler} failed at {target.name}: {why}')

    for generator, sources in LIBRARIES.items():
        link(libraries / f'lib{NAME}__{generator}.so', generator, sources, '$ORIGIN')
        done.append(f'-l{NAME}__{generator}')
    extension = made / PACKAGE / NAME / EXTENSION
    link(extension, PACKAGE, [EXTENSION_SOURCE], '$ORIGIN/../../..')


def fingerprint() -> str:
    """Return what a build depends on: recipe, message, Python and the wheels' versions."""
    recipe = [Path(__file__), *sorted(SOURCE.rglob('*.*'))]
    digest = hashlib.sha256(b''.join(path.read_bytes() for path in recipe))
    wheels = sorted(
        f'{found.name} {found.version}'
        for found in importlib.metadata.distributions()
        if found.name.startswith('ros-')
    )
    return '\n'.join([digest.hexdigest(), sys.version, *wheels, ''])


def state() -> str:
    """Return `current`, `stale` or `missing`; `foreign` when tf2_msgs is somebody else's."""
    stamp = SITE_PACKAGES / NAME / STAMP
    if stamp.is_file():
        return 'current' if stamp.read_text() == fingerprint() else 'stale'
    return 'foreign' if is_importable() else 'missing'


def is_importable() -> bool:
    """Whether some tf2_msgs is found: that of a sourced ROS, mostly."""
    return importlib.util.find_spec(NAME) is not None


def build() -> None:
    """
    Make tf2_msgs and install it into this environment; until it is complete none is there.

    Raises:
        CannotBuild: no compiler, no headers, or no wheels to build against.
    """
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(prefix=f'{NAME}-') as folder:
        made = Path(folder)
        generate(made)
        compile_libraries(made, compiler)
        check(made)
        install(made)


def check(made: Path) -> None:
    """
    Use the package that was made, in a process of its own.

    Raises:
        CannotBuild: with the last line of what went wrong.
    """
    libraries = [str(made / 'lib'), os.environ.get('LD_LIBRARY_PATH', '')]
    environment = {
        **os.environ,
        'PYTHONPATH': str(made / PACKAGE),
        'LD_LIBRARY_PATH': os.pathsep.join(filter(None, libraries)),
    }
    command = [sys.executable, '-c', CHECK]
    result = subprocess.run(command, env=environment, capture_output=True, text=True)
    if result.returncode:
        why = (result.stderr.splitlines() or [f'status {result.returncode}'])[-1]
        raise CannotBuild(f'what was built does not work: {why}')


def install(made: Path) -> None:
    """Put libraries, interface files and index entries into place, and the package last."""
    package, arriving = SITE_PACKAGES / NAME, SITE_PACKAGES / f'.{NAME}.new'
    shutil.rmtree(package, ignore_errors=True)
    for path in (made / 'lib').iterdir():
        _place(path, TARGET / 'lib' / path.name)
    share, index = TARGET / 'share' / NAME, TARGET / 'share/ament_index/resource_index'
    _place(SOURCE / 'package.xml', share / 'package.xml')
    for folder in (SOURCE, made / 'idl' / NAME, made / DESCRIPTION / NAME):
        for path in folder.glob(f'{MESSAGE}.*'):
            _place(path, share / 'msg' / path.name)
    (index / 'packages' / NAME).touch()
    (index / 'rosidl_interfaces' / NAME).write_text(f'{MESSAGE}.idl\n{MESSAGE}.msg\n')
    shutil.rmtree(arriving, ignore_errors=True)
    shutil.copytree(made / PACKAGE / NAME, arriving, ignore=shutil.ignore_patterns('*.c'))
    (arriving / STAMP).write_text(fingerprint())
    arriving.rename(package)


def _place(path: Path, target: Path) -> None:
    """Copy a file so that nobody who has it open, or stops us, sees half of it."""
    target.parent.mkdir(parents=True, exist_ok=True)
    arriving = target.with_name(f'.{target.name}.new')
    shutil.copy(path, arriving)
    arriving.replace(target)


def main() -> int:
    """Build tf2_msgs where it is missing or stale; return the exit status."""
    if state() in ('current', 'foreign'):
        print(f'{NAME} is there')
        return 0
    started = time.monotonic()
    try:
        build()
    except (UserError, OSError) as error:
        again = f'{sys.executable} -m robot_description.{Path(__file__).stem}'
        print(f'error: no {NAME}, so no /tf: {error}; then: {again}', file=sys.stderr)
        return 2
    print(f'{NAME} built in {time.monotonic() - started:.1f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
