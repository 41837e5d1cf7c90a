# SPDX-License-Identifier: Apache-2.0
"""`--record`: what was published is in the file, whatever ends the run."""

from collections import defaultdict
from pathlib import Path
import resource
import signal
import time
from typing import Any

import pytest
from ros_types import store
from rosbags.rosbag2.storage_mcap import McapReader
from terminals import PATIENCE
from wasd_bringup.tools.recording.bag_writer import CHUNK_SIZE
from wasd_bringup.tools.recording.reader import BagReader

pytestmark = pytest.mark.slow

KEYS = '0.3 i*30\n1.4 j*60\n3.5 u*20\n4.3 ,*40'
DURATION = 6  # [s]


class Bag:
    """A recording, read with rosbags: types, times [ns] and messages by topic."""

    def __init__(self, path: Path) -> None:
        reader = McapReader(path)
        reader.open()
        self.types = {one.topic: one.msgtype for one in reader.connections}
        self.counts = {one.topic: one.msgcount for one in reader.connections}
        self.raw: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
        for connection, at, data in reader.messages(reader.connections):
            self.raw[connection.topic].append((at, bytes(data)))
        self.end = reader.metadata.end_time
        reader.close()

    def messages(self, topic: str) -> list[tuple[int, Any]]:
        """Return the time and the message of each on a topic."""
        kind = self.types[topic]
        return [(at, store().deserialize_cdr(data, kind)) for at, data in self.raw[topic]]


def nanoseconds(stamp: Any) -> int:
    """Return a stamp as one number [ns]."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


@pytest.fixture(scope='module')
def run(new_runner: Any) -> tuple[Bag, dict[str, Any], Any]:
    """Record mbot; return the recording, the report and the runner."""
    runner = new_runner()
    report = runner.report('mbot', '--record', 'run.mcap', '--duration', str(DURATION), play=KEYS)
    return Bag(runner.folder / 'run.mcap'), report, runner


def test_every_topic_is_there_with_its_type_and_count(run: Any) -> None:
    bag, _, _ = run
    expected = {
        '/clock': ('rosgraph_msgs/msg/Clock', 100 * DURATION),
        '/joint_states': ('sensor_msgs/msg/JointState', 50 * DURATION),
        '/ground_truth/odom': ('nav_msgs/msg/Odometry', 50 * DURATION),
        '/odom': ('nav_msgs/msg/Odometry', 50 * DURATION),
        '/keys': ('std_msgs/msg/String', 150),
        '/robot_description': ('std_msgs/msg/String', 1),
    }
    assert (
        expected.items()
        <= {topic: (bag.types[topic], bag.counts[topic]) for topic in bag.types}.items()
    )
    assert bag.counts['/cmd_vel'] > 260
    assert {topic: len(found) for topic, found in bag.raw.items()} == bag.counts


def test_each_message_is_there_at_the_time_of_its_stamp(run: Any) -> None:
    bag, _, _ = run
    for topic in ('/joint_states', '/ground_truth/odom', '/odom'):
        stamps = [
            (m.header.stamp.sec * 10**9 + m.header.stamp.nanosec, at)
            for at, m in bag.messages(topic)
        ]
        assert stamps == [(20_000_000 * tick, 20_000_000 * tick) for tick in range(50 * DURATION)]
    clock = [(m.clock.sec * 10**9 + m.clock.nanosec, at) for at, m in bag.messages('/clock')]
    assert clock == [(10_000_000 * tick, 10_000_000 * tick) for tick in range(100 * DURATION)]


def test_the_messages_say_what_the_report_says(run: Any) -> None:
    bag, report, _ = run
    truth = [m.pose.pose.position for _, m in bag.messages('/ground_truth/odom')]
    assert [[p.x, p.y, p.z] for p in truth] == report['samples']['position']
    odometry = [m.pose.pose.position for _, m in bag.messages('/odom')]
    assert [[p.x, p.y] for p in odometry] == [row[:2] for row in report['samples']['odom']]


def test_transforms_are_recorded_where_they_are_published(run: Any) -> None:
    pytest.importorskip('tf2_msgs', reason='tf2_msgs is not built')
    bag, _, _ = run
    assert bag.types['/tf'] == bag.types['/tf_static'] == 'tf2_msgs/msg/TFMessage'
    assert (bag.counts['/tf'], bag.counts['/tf_static']) == (100 * DURATION, 1)


def test_the_same_run_gives_the_same_messages(run: Any) -> None:
    bag, _, runner = run
    runner.report('mbot', '--record', 'again.mcap', '--duration', '4', play=KEYS)
    again = Bag(runner.folder / 'again.mcap')
    # How fast the machine is, once a second of wall time, is not part of the run.
    for topic in bag.raw.keys() - {'/diagnostics'}:
        found = [(at, said) for at, said in again.messages(topic) if at < 4 * 10**9]
        # By what is written of them: a NaN is none other.
        assert repr(found) == repr(bag.messages(topic)[: len(found)])
    assert len(again.raw['/joint_states']) == 200


def test_killed_it_opens_with_all_that_was_saved(new_runner: Any) -> None:
    runner = new_runner()
    path = runner.folder / 'killed.mcap'
    process = runner.start('mbot', '--viewer', 'none', '--duration', '999', '--record', path.name)
    deadline = time.monotonic() + PATIENCE
    seen = [0.0]
    while len(seen) < 4:  # it can be read while it grows, second by second
        assert time.monotonic() < deadline
        time.sleep(0.2)
        if path.exists() and path.stat().st_size:
            end = 1e-9 * BagReader(path).end
            seen += [end] if end > seen[-1] else []
    process.send_signal(signal.SIGKILL)
    process.wait(PATIENCE)
    bag = BagReader(path)
    assert 1e-9 * bag.end >= seen[-1]
    topics = {topic.name for topic in bag.topics if topic.messages}
    assert {'/clock', '/joint_states', '/odom', '/robot_description'} <= topics


def test_a_full_disk_stops_the_run_in_one_line_and_keeps_what_was_written(
    new_runner: Any,
) -> None:
    runner = new_runner()
    room = 5 * CHUNK_SIZE // 2  # for two chunks, however fast a machine fills them
    done = runner(
        *('mbot', '--duration', '60', '--speed', '0', '--record', 'big.mcap'),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
    )
    assert done.returncode == 2
    assert done.stderr == 'error: --record big.mcap: File too large\n'
    counts = {topic.name: topic.messages for topic in BagReader(runner.folder / 'big.mcap').topics}
    assert counts['/clock'] > 100
