# SPDX-License-Identifier: Apache-2.0
"""What ends leaves nothing behind: no log in the home, no file in the temporary folder."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# One node, as all are started alike, and one run.
PROGRAMS = {
    'diff_drive_controller': ('diff_drive_sim.diff_drive_controller_node',),
    'wasd': ('wasd_bringup.cli', 'mbot', '--duration', '600'),
}


def wait_until_it_catches(process: 'subprocess.Popen[bytes]', number: int) -> None:
    """Wait until a process has a handler for a signal: until it has been loaded."""
    caught, deadline = 0, time.monotonic() + PATIENCE
    while not caught >> (number - 1) & 1:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.1)
        status = Path(f'/proc/{process.pid}/status').read_text()
        caught = int(status.partition('SigCgt:')[2].split()[0], 16)


@pytest.mark.parametrize('name', PROGRAMS)
def test_a_start_and_a_stop_leave_nothing_behind(
    tmp_path: Path, isolated_ros: int, name: str
) -> None:
    home, temporary = tmp_path / 'home', tmp_path / 'tmp'
    home.mkdir()
    temporary.mkdir()
    environment = {**os.environ, 'HOME': str(home), 'TMPDIR': str(temporary)}
    del environment['ROS_LOG_DIR']
    process = subprocess.Popen(
        [sys.executable, '-m', *PROGRAMS[name]],
        env=environment,
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    wait_until_it_catches(process, signal.SIGTERM)
    time.sleep(2.0)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode in (0, 128 + signal.SIGTERM), said
    assert [path for path in temporary.rglob('*') if path.is_file()] == []
    # Compiled code and converted meshes are kept, once; logs are not.
    assert list(home.rglob('*.log')) == []
    assert not (home / '.ros').exists()
