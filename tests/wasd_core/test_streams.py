# SPDX-License-Identifier: Apache-2.0
"""Standard output and error that are closed, full, or not read."""

import os
from pathlib import Path
import subprocess
import sys

import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

FULL = Path('/dev/full')
DESCRIBE = ('robot_description.describe_command', 'expand', 'go2')
KEYS = ('wasd_bringup.cli', 'keys')
# Says a lot, and what it was told by what it could not say.
WRITER = """
import sys, time
from wasd_core import streams
streams.prepare_streams()
if 'never' in sys.argv:
    streams.never_wait()
started = time.monotonic()
for _ in range(100):
    print('x' * 10_000)
    print('y' * 10_000, file=sys.stderr)
sys.exit(3)
"""


def run(words, redirection, **options):
    """Run a program as a shell would with redirections; return what comes through pipes."""
    command = f'exec "$0" -m "$@" {redirection}'
    return subprocess.run(
        ['/bin/sh', '-c', command, sys.executable, *words],
        text=True,
        timeout=PATIENCE,
        **{'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, **options},
    )


@pytest.mark.parametrize('words', [DESCRIBE, KEYS], ids=['describe', 'wasd'])
@pytest.mark.skipif(not FULL.exists(), reason='no /dev/full')
def test_a_full_disk_is_one_line_and_status_1(words):
    done = run(words, '>/dev/full')
    assert (done.returncode, done.stderr) == (
        1,
        'error: standard output: No space left on device\n',
    )


@pytest.mark.parametrize(
    ('words', 'closed'),
    [
        (DESCRIBE, '<&- >&- 2>&-'),
        *((KEYS, closed) for closed in ('>&-', '<&-', '>&- 2>&-', '<&- >&- 2>&-')),
    ],
)
def test_closed_streams_are_silence(words, closed):
    done = run(words, closed)
    assert (done.returncode, done.stderr) == (0, '')


@pytest.mark.parametrize('words', [DESCRIBE, KEYS], ids=['describe', 'wasd'])
def test_a_reader_that_has_had_enough_is_silence(words):
    reading, writing = os.pipe()
    os.close(reading)
    done = run(words, '', stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, '')


def test_an_error_that_nobody_can_read_keeps_its_status():
    assert run(('wasd_bringup.cli', 'go3'), '2>/dev/full').returncode == 2
    assert run(('wasd_bringup.cli', 'go3'), '2>&-').returncode == 2


def test_a_pipe_that_nobody_reads_does_not_stop_what_never_waits():
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [sys.executable, '-c', WRITER, 'never'], stdout=writing, stderr=writing
    )
    assert process.wait(PATIENCE) == 3
    # Ours is the other opening of the pipe: it is as it was.
    assert os.get_blocking(writing)
    os.close(writing)
    assert os.read(reading, 5) == b'xxxxx'
    os.close(reading)


def test_what_may_wait_loses_nothing():
    done = subprocess.run(
        [sys.executable, '-c', f'import time\n{WRITER}'], capture_output=True, timeout=PATIENCE
    )
    assert done.returncode == 3
    assert (len(done.stdout), len(done.stderr)) == (100 * 10_001, 100 * 10_001)
    assert b'x' * 10_000 + b'\n' in done.stdout
