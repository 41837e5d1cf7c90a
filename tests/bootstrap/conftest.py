# SPDX-License-Identifier: Apache-2.0
"""A checkout in a world of its own: the tools `./wasd` may use, and a Python that pretends."""

from collections.abc import Iterator
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

import pytest
from terminals import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
TOOLS = (
    'cat cksum dirname find flock ls mkdir mv readlink rm sed sh sleep tail uname touch ln chmod'
)

# Answers what `./wasd` asks of a Python, and notes each question in $FAKE/calls. The version
# question runs for real, in a Python that first runs the file `looks` beside it.
PYTHON = """#!/bin/sh
echo "NAME $*" >>"$FAKE/calls"
venv=$(dirname "$(dirname "$0")")
case "$*" in
  '-I -c '*) "$REAL" -I -S -c "import sys; code = sys.argv[1]; exec(open(sys.argv[2]).read())
exec(code)" "$3" "$(readlink -f "$0").looks" ;;
  *lock.py*) echo "range==1 $*" ;;
  *'import numpy'*) echo numpy==1.26.4 ;;
  *'import rclpy') [ -e "$FAKE/rclpy" ] ;;
  *--version) echo Python 3.12.0 ;;
  *'-m venv'*)
    for folder; do :; done
    mkdir -p "$folder/bin" && ln -s "$(readlink -f "$0")" "$folder/bin/python" ;;
  *'-m quadruped_sim')
    trap 'sleep 0.2; exit 1' TERM
    echo $$ >"$FAKE/compiling.new"; mv "$FAKE/compiling.new" "$FAKE/compiling"
    while [ -e "$FAKE/slow-compiler" ]; do sleep 0.02; done ;;
  *compileall*) [ ! -e "$FAKE/unwritable" ] || { echo 'no room'; exit 1; } ;;
  *build_interfaces) [ ! -e "$FAKE/no-compiler" ] || { echo 'error: no compiler' >&2; exit 2; } ;;
  *'-m pip'*)
    case "$*" in *--quiet*) ;; *) echo 'Collecting something' ;; esac
    echo 'Getting requirements ... done'
    echo 'Collecting something==1.0 (from nowhere)' >"$venv/install.log"
    touch "$venv/rubble" "$FAKE/pip-started"
    while [ -e "$FAKE/slow" ]; do sleep 0.02; done
    if [ -e "$FAKE/pip-error" ]; then cat "$FAKE/pip-error" >"$venv/install.log"; exit 1; fi
    cat "$FAKE/command" >"$venv/bin/wasd" && chmod +x "$venv/bin/wasd" ;;
esac
"""

# The installed command: shows its arguments and what surrounds it.
COMMAND = """#!/bin/sh
for argument; do echo "argument: $argument"; done
echo "home=${PYTHONHOME-} path=${PYTHONPATH-} guard=${_ROS_WHEELS_BOOTSTRAP_COMPLETE-}"
echo "libraries=${LD_LIBRARY_PATH-} prefix=$AMENT_PREFIX_PATH usersite=${PYTHONNOUSERSITE-}"
"""

FIT = "import types; sys.modules['ensurepip'] = sys.modules['venv'] = types\n"


class Checkout:
    """A copy of the script with the files that it reads, and the handles of its fake world."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / 'check out'
        self.tools = folder / 'tools'
        self.fake = folder / 'fake'
        self.other_tools = folder / 'usr'
        for made in (self.folder / 'package', self.tools, self.fake, self.other_tools):
            made.mkdir(parents=True)
        for name in ('wasd', 'wasd_bringup/install.sh'):
            text = (ROOT / name).read_text()
            path = self.folder / name
            path.parent.mkdir(exist_ok=True)
            # The one absolute path there would let the real machine in.
            path.write_text(text.replace('/usr/bin/python3', str(self.other_tools / 'python3')))
        self.script.chmod(0o755)
        (self.folder / 'pyproject.toml').write_text('requires-python = ">=3.11"\n')
        (self.folder / 'requirements').mkdir()
        self.set_locked('.'.join(map(str, sys.version_info[:2])))
        (self.folder / 'package' / 'package.xml').write_text('<version>1</version>\n')
        for tool in TOOLS.split():
            found = shutil.which(tool)
            if found is None:
                pytest.skip(f'{tool} is not installed')
            (self.tools / tool).symlink_to(found)
        (self.fake / 'calls').touch()
        (self.fake / 'command').write_text(COMMAND)
        self.add_python('python3')

    @property
    def script(self) -> Path:
        """The script under test."""
        return self.folder / 'wasd'

    @property
    def venv(self) -> Path:
        """The folder of the default environment."""
        return self.folder / '.venv'

    def set_locked(self, *versions: str) -> None:
        """Say for which Pythons there are versions that were tried."""
        for name in ('run', 'test'):
            path = self.folder / 'requirements' / f'{name}.txt'
            path.write_text(f'# For CPython {", ".join(versions)} on Linux.\n')

    def add_python(self, name: str, looks: str = FIT) -> None:
        """Put a Python on the PATH; `looks` is run before the script's question to it."""
        self.add_tool(name, PYTHON.replace('NAME', name))
        (self.tools / f'{name}.looks').write_text(looks)

    def add_tool(self, name: str, text: str) -> None:
        """Put an executable script on the PATH, in place of the tool of that name."""
        path = self.tools / name
        path.unlink(missing_ok=True)
        path.write_text(text)
        path.chmod(0o755)

    def environment(self, **extra: str) -> dict[str, str]:
        """Return the variables that a start sees: the fake world and `extra`."""
        real = os.path.realpath(sys.executable)
        return {'PATH': str(self.tools), 'FAKE': str(self.fake), 'REAL': real, **extra}

    def start(
        self, *arguments: str, terminal: int | None = None, **extra: str
    ) -> subprocess.Popen[str]:
        """Start the script in a process group of its own, perhaps on a terminal."""
        return subprocess.Popen(
            [extra.pop('script', str(self.script)), *arguments],
            env=self.environment(**extra),
            cwd=self.folder.parent,
            stdin=subprocess.DEVNULL if terminal is None else terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
            stderr=subprocess.PIPE if terminal is None else terminal,
            text=True,
            start_new_session=True,
        )

    def run(self, *arguments: str, **extra: str) -> subprocess.CompletedProcess[str]:
        """Run the script to its end."""
        process = self.start(*arguments, **extra)
        return self.finish(process)

    def run_read_only(self, **extra: str) -> subprocess.CompletedProcess[str]:
        """Run with the checkout read-only; modes do not stop root, so root mounts it so."""
        if os.geteuid() == 0:
            return self._run_mounted(self.environment(**extra))
        made = [path for path in (self.folder, self.venv) if path.is_dir()]
        for folder in made:
            folder.chmod(0o555)
        try:
            return self.run(**extra)
        finally:
            for folder in made:
                folder.chmod(0o755)

    def _run_mounted(self, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
        start = 'PATH=$1 exec "$2"'
        mount = f'mount --bind . . && mount -o remount,ro,bind . || exit 99; cd .. ; {start}'
        command = ['unshare', '-m', 'sh', '-c', mount, 'sh', environment['PATH'], str(self.script)]
        environment = {**environment, 'PATH': os.environ['PATH']}
        if shutil.which('unshare') is None:
            pytest.skip('unshare is not installed')
        result = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True
        )
        if result.returncode == 99 or 'unshare failed' in result.stderr:
            pytest.skip('root may not mount anything read-only here')
        return result

    def finish(self, process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
        """Wait for the end of a start and return what came out of it."""
        output, errors = process.communicate(timeout=PATIENCE)
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    def stop_while_installing(self, number: signal.Signals) -> subprocess.CompletedProcess[str]:
        """Start, and send a signal to everything that runs once pip does, as a terminal would."""
        (self.fake / 'slow').touch()
        process = self.start()
        self.wait_for(self.fake / 'pip-started')
        os.killpg(process.pid, number)
        result = self.finish(process)
        (self.fake / 'slow').unlink()
        return result

    def stop_while_compiling(self, number: signal.Signals) -> subprocess.CompletedProcess[str]:
        """Likewise, once pip is through and the legs are compiled."""
        (self.fake / 'slow-compiler').touch()
        process = self.start()
        self.wait_for(self.fake / 'compiling')
        os.killpg(process.pid, number)
        result = self.finish(process)
        (self.fake / 'slow-compiler').unlink()
        return result

    def wait_for(self, path: Path) -> None:
        """Return once `path` exists."""
        end = time.monotonic() + PATIENCE
        while not path.exists():
            assert time.monotonic() < end, f'{path} did not appear'
            time.sleep(0.01)

    def calls(self, part: str = '') -> list[str]:
        """Return what Pythons were asked that contains `part`, and forget all of it."""
        path = self.fake / 'calls'
        lines = path.read_text().splitlines()
        path.write_text('')
        return [line for line in lines if part in line]


@pytest.fixture
def checkout(tmp_path: Path) -> Iterator[Checkout]:
    """A fresh checkout in a folder whose name has a space."""
    made = Checkout(tmp_path)
    yield made
    for name in ('slow', 'slow-compiler'):  # whatever still waits for it ends
        (made.fake / name).unlink(missing_ok=True)
