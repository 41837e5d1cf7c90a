# SPDX-License-Identifier: Apache-2.0
"""What `.ci/run` makes of failures, hangs and Ctrl-C; the commands it runs are pretended."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import shutil
import signal
import subprocess
import time

import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
TOOLS = 'bash cat dirname env ls mkdir mktemp nice readlink rm sh sleep timeout'
# `./wasd`: each command notes its process, and does what a file that is named after it says.
WASD = """#!/bin/sh
case "$*" in *--version) exit ;; esac
[ "$1" != demo ] || mkdir -p "$5"
[ "$1" != test ] || trap 'exit 2' INT
echo $$ >"$FAKE/$1.new"; mv "$FAKE/$1.new" "$FAKE/$1.pid"
while [ -e "$FAKE/slow-$1" ]; do sleep 0.02; done
[ ! -e "$FAKE/bad-$1" ] || { echo "a finding of $1"; exit 3; }
"""


class Ci:
    """A copy of the script among commands that pretend, without Debian's tools."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.fake, self.temporary = (folder / it for it in ('a', 'fake', 'tmp'))
        self.tools = folder / 'tools'
        for made in (self.folder / '.ci', self.folder / '.venv/bin', self.fake, self.temporary):
            made.mkdir(parents=True)
        self.tools.mkdir()
        for tool in [*TOOLS.split(), 'mv']:
            (self.tools / tool).symlink_to(shutil.which(tool) or pytest.skip(f'no {tool}'))
        (self.folder / '.ci/run').write_text((ROOT / '.ci/run').read_text())
        for name, text in (('wasd', WASD), ('.venv/bin/python', '#!/bin/sh\n')):
            (self.folder / name).write_text(text)
            (self.folder / name).chmod(0o755)

    def hurry(self) -> None:
        """Give what runs beside the tests three seconds, in which it gives way to nobody."""
        script, nice = self.folder / '.ci/run', self.tools / 'nice'
        text = script.read_text()
        assert 'LEISURE=3600\n' in text
        script.write_text(text.replace('LEISURE=3600\n', 'LEISURE=3\n'))
        nice.unlink()
        nice.write_text('#!/usr/bin/env bash\nshift 2\nexec "$@"\n')
        nice.chmod(0o755)

    def start(self) -> subprocess.Popen[str]:
        """Start it in a process group of its own, as a terminal does."""
        paths = {'PATH': str(self.tools), 'FAKE': str(self.fake), 'TMPDIR': str(self.temporary)}
        return subprocess.Popen(
            ['bash', str(self.folder / '.ci/run')],
            env=paths,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def finish(self, process: subprocess.Popen[str]) -> tuple[int, str, str]:
        """Return its status and what it wrote; nothing temporary is left then."""
        output, errors = process.communicate(timeout=PATIENCE)
        assert not list(self.temporary.iterdir())
        return process.returncode, output, errors

    def process_of(self, command: str) -> int:
        """Return the number of the process of a command, once it has begun."""
        path, end = self.fake / f'{command}.pid', time.monotonic() + PATIENCE
        while not path.exists():
            assert time.monotonic() < end, f'{command} did not begin'
            time.sleep(0.01)
        return int(path.read_text())


@pytest.fixture
def ci(tmp_path: Path) -> Iterator[Ci]:
    """A script in a world of its own."""
    made = Ci(tmp_path)
    yield made
    for path in made.fake.glob('slow-*'):  # whatever still waits for it ends
        path.unlink()


def test_what_passes_ends_with_passed_and_shows_what_ran_beside_the_tests(ci: Ci) -> None:
    status, output, errors = ci.finish(ci.start())
    assert (status, errors) == (0, '')
    steps = [line.split(' (after')[0] for line in output.splitlines() if line.startswith('== ')]
    assert steps[2:] == ['== ./wasd lint', '== ./wasd demo', '== passed']


def test_a_test_that_fails_once_is_a_failure(ci: Ci) -> None:
    (ci.fake / 'bad-test').touch()
    status, output, errors = ci.finish(ci.start())
    assert (status, output.count('a finding of test')) == (1, 1)
    assert errors == '.ci/run: the tests failed with status 3, see above\n'


@pytest.mark.parametrize('command', ['lint', 'demo'])
def test_a_failure_beside_the_tests_is_shown_and_said_last(ci: Ci, command: str) -> None:
    (ci.fake / f'bad-{command}').touch()
    status, output, errors = ci.finish(ci.start())
    assert (status, f'a finding of {command}' in output) == (1, True)
    assert errors == '.ci/run: lint or demo failed with status 3, see above\n'


def test_a_hang_beside_the_tests_ends_and_is_said(ci: Ci) -> None:
    ci.hurry()
    (ci.fake / 'slow-demo').touch()
    status, _, errors = ci.finish(ci.start())
    assert (status, errors) == (1, '.ci/run: lint and demo were not through after 3 s\n')
    assert_gone(ci.process_of('demo'))


@pytest.mark.parametrize('stop', [os.killpg, os.kill], ids=['ctrl-c', 'terminated'])
def test_stopped_it_leaves_nothing_running(ci: Ci, stop: Callable[[int, int], None]) -> None:
    (ci.fake / 'slow-test').touch()
    (ci.fake / 'slow-demo').touch()
    process = ci.start()
    ci.process_of('test')
    demo = ci.process_of('demo')
    number = signal.SIGINT if stop is os.killpg else signal.SIGTERM
    stop(process.pid, number)
    (ci.fake / 'slow-test').unlink()
    assert ci.finish(process)[0] in (130, -number)
    assert_gone(demo)


def assert_gone(process: int) -> None:
    """Assert that a process has ended."""
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
