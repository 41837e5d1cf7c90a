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
import types

from cases import for_all
import pytest
from terminals import PATIENCE, wait_until
from wasd_core.errors import UserError
from wasd_core.network import do_without_shared_memory, PROFILE, PROFILES_FILE, RANGE, UDP_PROFILE
from wasd_core.shared_memory import (
    look_before_ros,
    remove_segments_of_the_dead,
    SHARED_MEMORY,
    why_no_shared_memory,
)

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


@pytest.mark.slow
@pytest.mark.skipif(not SHARED_MEMORY.is_dir(), reason='no /dev/shm')
def test_what_a_killed_node_leaves_goes_when_it_is_dead_but_not_before(isolated_ros: int) -> None:
    words = [sys.executable, '-m', 'teleop_keyboard.twist_mux_node']
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + PATIENCE
        while not (mine := segments_of(process.pid)):
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.1)
        for name in mine:
            os.utime(SHARED_MEMORY / f'{name}_el', (0.0, 0.0))
        assert not mine & set(remove_segments_of_the_dead())
        for name in mine:
            os.utime(SHARED_MEMORY / f'{name}_el')  # others start meanwhile, and leave young ones
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert all((SHARED_MEMORY / name).exists() for name in mine)
    for name in mine:
        os.utime(SHARED_MEMORY / f'{name}_el', (0.0, 0.0))
    # Another start may be about to.
    remove_segments_of_the_dead()
    ends = [f'{name}{end}' for name in mine for end in ('', '_el')]
    wait_until(lambda: not any((SHARED_MEMORY / name).exists() for name in ends))


@for_all('name', ['fastrtps_port7411', 'sem.fastrtps_port7649_mutex'])
def test_an_old_empty_port_or_lock_of_the_domain_is_not_waited_for(name, tmp_path, monkeypatch):
    assert why_no_shared_memory(0, tmp_path) == ''
    (tmp_path / name).touch()
    os.utime(tmp_path / name, (0.0, 0.0))
    monkeypatch.setattr(time, 'sleep', lambda _: pytest.fail('waited for nobody'))
    assert why_no_shared_memory(0, tmp_path) == f'{tmp_path / name} is empty: remove it'
    assert why_no_shared_memory(1, tmp_path) == ''
    (tmp_path / name).write_bytes(b'data')
    assert why_no_shared_memory(0, tmp_path) == ''
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to('/dev/null')
    assert why_no_shared_memory(0, tmp_path) == f'{tmp_path / name} is no file'


def test_an_empty_port_that_a_neighbour_is_making_is_waited_for(tmp_path, monkeypatch):
    path = tmp_path / 'fastrtps_port7650'
    path.touch()
    began, slept = path.stat().st_mtime, 0.0

    def sleep(seconds):
        nonlocal slept
        slept += seconds
        if slept > took:
            path.write_bytes(b'data')

    clock = types.SimpleNamespace(monotonic=lambda: slept, time=lambda: began + slept, sleep=sleep)
    monkeypatch.setattr('wasd_core.shared_memory.time', clock)
    took = 2.0
    assert why_no_shared_memory(1, tmp_path) == f'{path} is empty: remove it'
    took, slept = 0.7, 0.0  # the neighbour has to wait for a processor
    assert why_no_shared_memory(1, tmp_path) == ''


def test_a_folder_that_cannot_be_used_is_said(tmp_path, monkeypatch):
    assert why_no_shared_memory(0, tmp_path / 'none').endswith('none: No such file or directory')
    look_before_ros(tmp_path / 'none')
    size = os.statvfs(tmp_path)
    small = {name: getattr(size, name) for name in dir(size) if name.startswith('f_')}
    full = types.SimpleNamespace(**{**small, 'f_bavail': 1, 'f_frsize': 4096})
    monkeypatch.setattr(os, 'statvfs', lambda path: full)
    assert 'is full: 0.0 MB' in why_no_shared_memory(0, tmp_path)
    with pytest.raises(UserError, match='ROS cannot be loaded: .* is full: make room'):
        look_before_ros(tmp_path)
    for name in ('lttng-ust-wait-6', 'lttng-ust-wait-6-0'):  # as an earlier start made them
        (tmp_path / name).write_bytes(bytes(4096))
    look_before_ros(tmp_path)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root gives files away')
def test_a_port_of_another_user_is_not_used(tmp_path):
    (tmp_path / 'fastrtps_port7411').write_bytes(b'data')
    os.chown(tmp_path / 'fastrtps_port7411', 1234, 1234)
    assert why_no_shared_memory(0, tmp_path).endswith('port7411 belongs to user 1234')


def test_without_shared_memory_the_same_are_reached_by_udp_alone():
    def meaning(path):
        text = re.sub(r'<!--.*?-->|\s', '', path.read_text(), flags=re.DOTALL)
        name = '<transport_id>this_machine_shared_memory</transport_id>'
        text = text.replace(
            f'<transport_descriptor>{name}<type>SHM</type></transport_descriptor>', ''
        )
        return text.replace(name, '')

    assert meaning(UDP_PROFILE) == meaning(PROFILE)
    assert 'SHM' not in UDP_PROFILE.read_text()
    ours = {RANGE: 'SYSTEM_DEFAULT', PROFILES_FILE: str(UDP_PROFILE)}
    for before, after in (
        ({RANGE: 'SYSTEM_DEFAULT', PROFILES_FILE: str(PROFILE)}, ours),
        ({RANGE: 'LOCALHOST'}, ours),
        ({'ROS_LOCALHOST_ONLY': '1', PROFILES_FILE: 'mine'}, ours),
        ({RANGE: 'OFF'}, {RANGE: 'OFF', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}),
        ({}, {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}),
        ({'FASTDDS_BUILTIN_TRANSPORTS': 'X'}, {'FASTDDS_BUILTIN_TRANSPORTS': 'X'}),
    ):
        do_without_shared_memory(before)
        assert before == after
