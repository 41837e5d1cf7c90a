# SPDX-License-Identifier: Apache-2.0
"""What killed processes left in shared memory is removed; what lives stays."""

import fcntl
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

import pytest
from wasd_core.network import remove_segments_of_the_dead
from wasd_core.network import SHARED_MEMORY

DEAD, LIVING = '0123456789abcdef', 'fedcba9876543210'


def make(folder: Path, name: str, age: float) -> Path:
    """Make a segment and its lock, last written `age` [s] ago; return the lock."""
    (folder / f'fastrtps_{name}').write_bytes(b'data')
    lock = folder / f'fastrtps_{name}_el'
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    return lock


def test_only_a_segment_whose_lock_is_free_and_old_is_removed(tmp_path: Path) -> None:
    make(tmp_path, DEAD, 100.0)
    make(tmp_path, '1' * 16, 1.0)
    (tmp_path / 'fastrtps_port7411_el').touch()
    os.utime(tmp_path / 'fastrtps_port7411_el', (0.0, 0.0))
    with make(tmp_path, LIVING, 100.0).open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert remove_segments_of_the_dead(tmp_path) == [f'fastrtps_{DEAD}']
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f'fastrtps_{"1" * 16}',
        f'fastrtps_{"1" * 16}_el',
        f'fastrtps_{LIVING}',
        f'fastrtps_{LIVING}_el',
        'fastrtps_port7411_el',
    ]


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    folder, other = tmp_path / 'shm', tmp_path / 'mine'
    folder.mkdir()
    other.write_text('mine')
    os.utime(other, (0.0, 0.0))
    (folder / f'fastrtps_{DEAD}_el').symlink_to(other)
    assert remove_segments_of_the_dead(folder) == []
    assert other.read_text() == 'mine'


def test_without_the_folder_nothing_happens(tmp_path: Path) -> None:
    assert remove_segments_of_the_dead(tmp_path / 'none') == []


def segments_of(pid: int) -> set[str]:
    """Return the segments, not the ports, that a process has mapped."""
    maps = Path(f'/proc/{pid}/maps').read_text()
    return set(re.findall(r'/dev/shm/(fastrtps_[0-9a-f]{16})\b', maps))


@pytest.mark.skipif(not SHARED_MEMORY.is_dir(), reason='no /dev/shm')
def test_what_a_killed_node_leaves_goes_when_it_is_dead_but_not_before(isolated_ros: int) -> None:
    words = [sys.executable, '-m', 'teleop_keyboard.twist_mux_node']
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 60.0
        while not (mine := segments_of(process.pid)):
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.1)
        for name in mine:
            os.utime(SHARED_MEMORY / f'{name}_el', (0.0, 0.0))
        assert not mine & set(remove_segments_of_the_dead())
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert all((SHARED_MEMORY / name).exists() for name in mine)
    # Another start may have been quicker.
    remove_segments_of_the_dead()
    assert not any(
        (SHARED_MEMORY / f'{name}{end}').exists() for name in mine for end in ('', '_el')
    )
