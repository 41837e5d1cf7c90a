# SPDX-License-Identifier: Apache-2.0
"""
A shell in which a ROS 2 Jazzy is sourced, with an empty home: made of ROS' wheels, without apt.

They are unpacked for Debian's Python into a prefix, as /opt/ros/jazzy is, with what rosdep would
have installed from Ubuntu 24.04 in the versions it has there. `rosdep` itself is the one stand-in:
it installs nothing, but refuses keys that it does not know.
"""

from importlib.metadata import distributions
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig

from source_trees import copy_checkout, ROOT

PYTHON = '/usr/bin/python3'

# What rosdep gets from apt for our keys, and what that needs: versions of Ubuntu 24.04.
FROM_APT = {
    'python3-collada': 'pycollada==0.7.2 python-dateutil==2.8.2 six==1.16.0',
    'python3-numba': 'numba==0.58.1 llvmlite==0.41.1',
    'python3-numpy': 'numpy==1.26.4',
    'python3-pil': 'pillow==10.2.0',
    'python3-pytest': 'pytest==7.4.4 iniconfig==1.1.1 packaging==24.0 pluggy==1.4.0',
    'python3-rich': 'rich==13.7.1 markdown-it-py==3.0.0 mdurl==0.1.2 pygments==2.17.2',
    'python3-yaml': 'pyyaml==6.0.1',
}
# Of Jazzy itself, but not among its wheels.
FROM_ROS = {
    'pinocchio': (
        'pin==4.1.0 libpinocchio==4.1.0 coal==3.0.3 libcoal==3.0.3 eigenpy==3.13.0 cmeel'
        ' cmeel-boost==1.90.0 cmeel-assimp cmeel-octomap cmeel-qhull cmeel-urdfdom'
        ' cmeel-console-bridge cmeel-tinyxml2 cmeel-zlib'
    ),
    'xacro': 'xacro==2.1.1',
}
# Nothing here uses these: rosdep would install them all the same.
# What ./wasd builds where ROS comes as wheels.
BUILT = ('tf2_msgs', 'nav2_msgs')
NOT_HERE = {'launch', 'launch_ros', 'ros2launch', 'rviz2', *BUILT}
# colcon comes from apt, too; setuptools is what it builds with.
TOOLS = 'setuptools==68.1.2 lark-parser==0.12.0 lxml==5.2.1 wheel==0.42.0'

ROSDEP = """#!{python}
import pathlib, sys
import xml.etree.ElementTree as ElementTree
words, known = sys.argv[1:], set({known!r})
assert words[0] == 'install' and '--ignore-src' in words and '-y' in words, words
skipped = set(words[words.index('--skip-keys') + 1].split())
found = pathlib.Path(words[words.index('--from-paths') + 1]).glob('wasd/*/package.xml')
manifests = [ElementTree.parse(path).getroot() for path in found]
ours = {{m.findtext('name') for m in manifests}}
keys = {{e.text for m in manifests for e in m if e.tag.endswith('depend')}}
assert len(ours) == {count}, ours
if unknown := keys - ours - skipped - known:
    sys.exit(f'ERROR: no definition of {{sorted(unknown)}}')
"""

COLCON = """#!{python}
from colcon_core.command import main
raise SystemExit(main())
"""


def missing() -> str | None:
    """Return what this machine lacks for it, if anything."""
    done = subprocess.run([PYTHON, '-c', 'import ensurepip, pip, venv'], capture_output=True)
    return None if done.returncode == 0 else f'{PYTHON} lacks venv or pip: apt install python3-pip'


class SourcedJazzy:
    """The prefix, the home, and the environment of a shell that has sourced the one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.prefix, self.home = folder / 'opt', folder / 'home'
        self.home.mkdir()
        self._unpack()
        (self._site,) = self.prefix.glob('lib/python3.*/site-packages')
        self._copy_built()
        self._put_tools()
        self.environment = self._environment()

    def run(self, script: str, *words: str, **extra: str) -> 'subprocess.CompletedProcess[str]':
        """Run lines of bash, which stops at the first that fails."""
        return subprocess.run(
            ['bash', '-e', '-c', script, 'bash', *words],
            cwd=self.home,
            env={**self.environment, **extra},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )

    def clone_of_checkout(self) -> Path:
        """Return a repository with the checkout as it is now, to be cloned."""
        made = copy_checkout(self.folder / 'repository')
        words = ['-c', 'user.name=test', '-c', 'user.email=test@localhost']
        for arguments in (['init', '-q'], ['add', '-A'], [*words, 'commit', '-qm', 'as it is']):
            subprocess.run(['git', *arguments], cwd=made, check=True)
        return made

    def _unpack(self) -> None:
        tools = self.folder / 'tools'
        subprocess.run([PYTHON, '-m', 'venv', str(tools)], check=True)
        ros = {
            f'{found.name}=={found.version}'
            for found in distributions()
            if found.name.replace('_', '-').startswith('ros-')
            and 'bootstrapper' not in found.name
            and 'jazzy' not in found.name
        }
        rest = ' '.join([*FROM_APT.values(), *FROM_ROS.values(), TOOLS]).split()
        colcon = ['colcon-common-extensions>=0.3,<0.4', 'setuptools==68.1.2']
        pip = [str(tools / 'bin/python'), '-m', 'pip', 'install', '-q', '--prefix']
        whole = [*pip, str(self.prefix), '--ignore-installed']
        environment = clean_environment()
        for words in ([*whole, *colcon], [*whole, '--no-deps', *sorted(ros), *rest]):
            done = subprocess.run(words, env=environment, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr

    def _copy_built(self) -> None:
        """Take the interfaces that ./wasd has built; without them all but their use works."""
        ours = Path(sysconfig.get_path('purelib'))
        for name in BUILT:
            if not (ours / name).is_dir() or ours.parent.name != self._site.parent.name:
                continue
            shutil.copytree(ours / name, self._site / name)
            shutil.copytree(Path(sys.prefix, 'share', name), self.prefix / 'share' / name)
            for library in Path(sys.prefix, 'lib').glob(f'lib{name}*'):
                shutil.copy(library, self.prefix / 'lib')

    def _put_tools(self) -> None:
        tools = self.folder / 'bin'
        tools.mkdir()
        count = len(list(ROOT.glob('*/package.xml')))
        known = {*FROM_APT, *FROM_ROS, *NOT_HERE}
        known |= {path.name for path in (self.prefix / 'share').iterdir()}
        scripts = {
            'rosdep': ROSDEP.format(python=PYTHON, known=sorted(known), count=count),
            'colcon': COLCON.format(python=PYTHON),
        }
        for name, text in scripts.items():
            (tools / name).write_text(text)
            (tools / name).chmod(0o755)

    def _environment(self) -> dict[str, str]:
        """Return what a shell has after `. setup.bash`, and nothing of this process' own."""
        pinocchio = self._site / 'cmeel.prefix'
        libraries = [self.prefix / 'lib', *self._site.glob('ros_*.libs')]
        python = [self._site, pinocchio / f'lib/{self._site.parent.name}/site-packages']
        return {
            **clean_environment(),
            'HOME': str(self.home),
            'PATH': f'{self.folder / "bin"}:{self.prefix / "bin"}:/usr/bin:/bin',
            'ROS_DISTRO': 'jazzy',
            'ROS_LOG_DIR': str(self.folder / 'ros_log'),
            'AMENT_PREFIX_PATH': f'{self.prefix}:{pinocchio}',
            'PYTHONPATH': ':'.join(map(str, python)),
            'LD_LIBRARY_PATH': ':'.join(map(str, libraries)),
        }


def clean_environment() -> dict[str, str]:
    """Return the environment without what Python, ROS or a virtual environment has set in it."""
    theirs = ('AMENT_', 'COLCON_', 'LD_LIBRARY', 'PYTHON', 'ROS_', 'VIRTUAL_ENV', 'WASD_', '_ROS_')
    kept = {name: value for name, value in os.environ.items() if not name.startswith(theirs)}
    # What was downloaded once need not be again, also from an empty home.
    cache = os.environ.get('PIP_CACHE_DIR') or str(Path.home() / '.cache/pip')
    return {**kept, 'PIP_CACHE_DIR': cache, 'PYTHONDONTWRITEBYTECODE': '1'}
