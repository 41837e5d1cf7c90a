# SPDX-License-Identifier: Apache-2.0
"""What `wasd mbot` says of itself in a recording: its error, its slip, what it sees."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_types import store
from rosbags.rosbag2.storage_mcap import McapReader

pytestmark = pytest.mark.slow

ARC = '0 0.4 0 0.6\n2 0 0 0'
Messages = dict[tuple[int, int], Any]


def read(path: Path, topic: str) -> Messages:
    """Return the messages of a topic by their stamps."""
    reader = McapReader(path)
    reader.open()
    (connection,) = (one for one in reader.connections if one.topic == topic)
    data = [
        store().deserialize_cdr(raw, connection.msgtype)
        for *_, raw in reader.messages([connection])
    ]
    reader.close()
    return {(one.header.stamp.sec, one.header.stamp.nanosec): one for one in data}


@pytest.fixture(scope='module')
def record(new_runner: Callable[[], Any]) -> Callable[[int], Path]:
    """Return a function that records an arc in the room with a seed, and returns the file."""
    runner = new_runner()

    def record(seed: int) -> Path:
        name = f'{seed}_{len(list(runner.folder.glob("*.mcap")))}.mcap'
        words = ('--world', 'room', '--duration', '3', '--seed', str(seed), '--record', name)
        runner.report('mbot', *words, twist=ARC)
        return Path(runner.folder / name)

    return record


@pytest.fixture(scope='module')
def first(record: Callable[[int], Path]) -> Path:
    return record(1)


def test_odom_error_is_ground_truth_minus_odom_to_the_last_bit(first: Path) -> None:
    truths, estimates = read(first, '/ground_truth/odom'), read(first, '/odom')
    errors = read(first, '/odom_error')
    assert len(errors) == 150
    for stamp, error in errors.items():
        true, estimated = truths[stamp].pose.pose, estimates[stamp].pose.pose
        assert error.pose.pose.position.x == true.position.x - estimated.position.x
        assert error.pose.pose.position.y == true.position.y - estimated.position.y
        turn = error.pose.pose.orientation
        # Of the heading: both turns are about z.
        expected = true.orientation.z * estimated.orientation.w
        expected -= true.orientation.w * estimated.orientation.z
        assert turn.z == pytest.approx(expected, abs=1e-7)
    assert max(abs(error.pose.pose.position.x) for error in errors.values()) < 0.002


def test_wheels_that_drive_an_arc_hardly_slip(first: Path) -> None:
    slips = read(first, '/wheel_slip')
    cruising = [slip.position for stamp, slip in slips.items() if stamp[0] == 1]
    assert np.abs(cruising).max() < 0.01


def test_scans_are_of_the_room_and_repeat_with_the_seed(
    first: Path, record: Callable[[int], Path]
) -> None:
    scans, again = (read(path, '/scan') for path in (first, record(1)))
    assert len(scans) == 16  # 5.5 a second for 3 s, the first at 0; the last is not whole
    assert scans.keys() == again.keys()
    for stamp, scan in scans.items():
        np.testing.assert_array_equal(scan.ranges, again[stamp].ranges)
        assert np.isfinite(scan.ranges).mean() > 0.95  # an A1 loses one in a hundred
    assert np.mean(scans[0, 0].ranges[175:185]) == pytest.approx(3.0, abs=0.05)  # 3 cm each


def test_nobody_films_because_of_a_recording(first: Path) -> None:
    with pytest.raises(ValueError, match='not enough values'):
        read(first, '/camera/image_raw')
    assert len(read(first, '/camera/camera_info')) == 90
