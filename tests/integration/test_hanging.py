# SPDX-License-Identifier: Apache-2.0
"""A test that hangs ends with all that it has started, and the run says which one it was."""

import os
from pathlib import Path
import subprocess
import sys

import hanging
import pytest
from terminals import PATIENCE, wait_until

pytestmark = pytest.mark.slow

HANGS = """
from pathlib import Path
import subprocess, sys
def test_that_hangs():
    sleep = 'import time; time.sleep(900.0)'
    shell = 'echo $$ > child; "$0" -c "$1"; true'
    subprocess.run(['sh', '-c', shell, sys.executable, sleep], start_new_session=True)
"""


def test_a_worker_that_hangs_is_ended_with_what_it_has_started(tmp_path: Path) -> None:
    (tmp_path / 'test_it.py').write_text(HANGS)
    done = subprocess.run(
        [
            sys.executable,
            *['-m', 'pytest', '-n', '1', '-p', 'hanging', '--rootdir', '.', 'test_it.py'],
        ],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(Path(__file__).parents[1]), 'WASD_TEST_LIMIT': '4'},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == pytest.ExitCode.INTERNAL_ERROR, done.stdout
    assert 'test_it.py::test_that_hangs' in done.stdout
    child = int((tmp_path / 'child').read_text())
    # The shell's own child is in its session.
    wait_until(lambda: not [stat for stat in stats() if f' {child} ' in stat])


def stats() -> list[str]:
    """Return what the system knows of each process, its parent, group and session among it."""
    found = []
    for path in Path('/proc').glob('[0-9]*/stat'):
        try:
            found.append(' '.join(path.read_text().rpartition(')')[2].split()[:4]) + ' ')
        except OSError:
            continue
    return [stat for stat in found if stat[0] != 'Z']


@pytest.mark.parametrize(('seconds', 'limit'), [(1.0, hanging.LIMIT), (5000.0, 5000.0)])
def test_a_mark_makes_the_time_longer_and_never_shorter(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, seconds: float, limit: float
) -> None:
    said = []
    monkeypatch.setattr('faulthandler.dump_traceback_later', lambda at, **_: said.append(at))
    monkeypatch.setattr('faulthandler.cancel_dump_traceback_later', lambda: None)
    monkeypatch.delenv('WASD_TEST_LIMIT', raising=False)
    request.node.add_marker(pytest.mark.takes_up_to(seconds))
    protocol = hanging.pytest_runtest_protocol(request.node)
    next(protocol)
    protocol.close()
    assert said == [limit]
