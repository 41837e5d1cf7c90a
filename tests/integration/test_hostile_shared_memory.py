# SPDX-License-Identifier: Apache-2.0
"""What others left in /dev/shm, or no room there: a line says so, and each signal ends a run."""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

import pytest
from terminals import PATIENCE

BIN = Path(sys.prefix) / 'bin'
RUN = [str(BIN / 'wasd'), 'mbot', '--viewer', 'none', '--duration']
KEYS = [str(BIN / 'twist_mux')]
# Some ports of each domain there is.
NAMES = 'd=0; while [ $d -lt 233 ]; do for p in 0 1 2 10 11 12 13; do n=$((7400 + 250*d + p));'
MOUNT = 'mount -t tmpfs -o size=16m none /dev/shm || exit 99; chmod 1777 /dev/shm;'
STATES = {
    'empty ports of another user': f'{NAMES} : >/dev/shm/fastrtps_port$n; done; d=$((d+1)); done; '
    'chown 1234 /dev/shm/*;',
    'empty locks': f'{NAMES} : >/dev/shm/sem.fastrtps_port${{n}}_mutex; done; d=$((d+1)); done;',
    'nearly full': 'head -c 10m /dev/zero >/dev/shm/file;',
    'full': 'head -c 16m /dev/zero >/dev/shm/file;',
}
REACHES = ('LOCALHOST', 'OFF', 'SUBNET')

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which('unshare') is None, reason='only root mounts a /dev/shm'
    ),
]


@contextlib.contextmanager
def start(state: str, words: list[str]) -> Iterator['subprocess.Popen[str]']:
    """Yield a program, in a process of its own, that has a /dev/shm of its own."""
    process = subprocess.Popen(
        ['unshare', '-m', 'sh', '-c', f'{MOUNT} {STATES[state]} exec "$@"', 'sh', *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize(
    ('state', 'reach'),
    [
        *((state, '') for state in STATES if state != 'empty locks'),
        *(('empty locks', reach) for reach in REACHES),
    ],
)
def test_a_run_says_in_a_line_what_is_wrong_and_goes_without_it_where_that_can_be(
    state, reach, monkeypatch
):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', reach)
    with start(state, [*RUN, '0.1']) as run:
        said, errors = run.communicate(timeout=PATIENCE)
    if run.returncode == 99:
        pytest.skip('nothing may be mounted here')
    assert len(errors.splitlines()) == 1, errors
    if state == 'full':
        assert (run.returncode, said) == (2, '')
        assert errors.startswith('error: ROS cannot be loaded: /dev/shm is full')
    else:
        assert run.returncode == 0
        assert errors.startswith('wasd: uses UDP instead of shared memory: /dev/shm')


@pytest.mark.parametrize(
    ('state', 'number'),
    [
        ('nearly full', signal.SIGINT),
        ('empty ports of another user', signal.SIGQUIT),
        ('empty locks', signal.SIGTERM),
    ],
)
def test_each_signal_ends_a_run_that_found_it(state, number):
    with start(state, [*RUN, '1000']) as run:
        assert run.stderr is not None
        line = run.stderr.readline()  # said before ROS is initialised
        if not line and run.wait(PATIENCE) == 99:
            pytest.skip('nothing may be mounted here')
        run.send_signal(number)
        _, errors = run.communicate(timeout=PATIENCE)
    # In the midst of its start it cannot die of those that ask for a dump: it exits.
    statuses = {0} if number == signal.SIGINT else {128 + number, -number}
    assert run.returncode in statuses
    assert errors == ''


def test_a_node_that_is_started_alone_says_it_and_works():
    with start('empty ports of another user', KEYS) as node:
        assert node.stderr is not None
        assert 'uses UDP' in node.stderr.readline()
        node.send_signal(signal.SIGTERM)
        node.communicate(timeout=PATIENCE)
    assert node.returncode == 128 + signal.SIGTERM
