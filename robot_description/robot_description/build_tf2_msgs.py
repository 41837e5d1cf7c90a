# SPDX-License-Identifier: Apache-2.0
"""
Builds and installs tf2_msgs, which is not among ROS' wheels: `/tf` and `/tf_static` need it.

`./wasd` runs this once; by hand: `python -m robot_description.build_tf2_msgs`.
"""

import hashlib
import importlib.metadata
import importlib.util
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time

from wasd_core.errors import UserError

from robot_description import code_of_tf2_msgs
from robot_description.code_of_tf2_msgs import CannotBuild
from robot_description.code_of_tf2_msgs import DESCRIPTION
from robot_description.code_of_tf2_msgs import MESSAGE
from robot_description.code_of_tf2_msgs import NAME
from robot_description.code_of_tf2_msgs import PACKAGE
from robot_description.code_of_tf2_msgs import PREFIX
from robot_description.code_of_tf2_msgs import SOURCE

SITE_PACKAGES = Path(sysconfig.get_path('purelib'))
# What the installed package was made of; also the mark that it is ours.
STAMP = 'made_of.txt'

CHECK = """
from rclpy.serialization import deserialize_message, serialize_message
from tf2_msgs.msg import TFMessage
assert deserialize_message(serialize_message(TFMessage()), TFMessage) == TFMessage()
"""


def fingerprint() -> str:
    """Return what a build depends on: recipe, message, Python and the wheels' versions."""
    recipe = [Path(__file__), Path(code_of_tf2_msgs.__file__), *sorted(SOURCE.rglob('*.*'))]
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
    compiler = code_of_tf2_msgs.find_compiler()
    with tempfile.TemporaryDirectory(prefix=f'{NAME}-') as folder:
        made = Path(folder)
        code_of_tf2_msgs.generate(made)
        code_of_tf2_msgs.compile_libraries(made, compiler)
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
        _place(path, PREFIX / 'lib' / path.name)
    share, index = PREFIX / 'share' / NAME, PREFIX / 'share/ament_index/resource_index'
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
