# SPDX-License-Identifier: Apache-2.0
"""A recording keeps what was saved, and another library than the writer's reads it."""

import errno
import os
from pathlib import Path
import random

from builtin_interfaces.msg import Time
from cases import for_all
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from wasd_bringup.tools.recording import bag_writer
from wasd_bringup.tools.recording.bag_writer import BagWriter
from wasd_bringup.tools.recording.reader import BagReader, RecordingError
from wasd_bringup.tools.recording.recorder import full_definition, qos_text, to_bytes
from wasd_core.errors import UserError
from wasd_core.output_file import OutputError

pytest.importorskip('rosbags', reason="rosbags is not installed: the extra 'test'")

from ros_types import store  # noqa: E402
from rosbags.interfaces import QosDurability  # noqa: E402
from rosbags.rosbag2.storage_mcap import McapReader  # noqa: E402
from rosbags.typesys import get_types_from_msg  # noqa: E402

STRING = 'std_msgs/msg/String'
QOS = qos_text(QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))


def read(path: Path) -> list[tuple[str, int, bytes]]:
    """Return the messages of a recording, read with rosbags."""
    reader = McapReader(path)
    reader.open()
    found = [(c.topic, time, bytes(data)) for c, time, data in reader.messages(reader.connections)]
    assert reader.metadata.message_count == len(found)
    reader.close()
    return found


def read_ours(path: Path) -> list[tuple[str, int, bytes]]:
    """Return the messages of a recording, whole or broken off, read with our reader."""
    reader = BagReader(path)
    found = [message[:3] for message in reader.messages(('/a', '/b'))]
    assert sum(topic.messages for topic in reader.topics) == len(found)
    return found


@pytest.mark.slow
def test_whenever_it_is_saved_all_of_it_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_writer, 'CHUNK_SIZE', 700)
    path = tmp_path / 'a.mcap'
    writer = BagWriter(path, {'robot': 'mbot'})
    words = random.Random(1)
    kinds = [writer.add_channel('/a', STRING, full_definition(STRING), QOS)]
    written = []
    for time in range(300):
        if time == 100:
            kinds.append(writer.add_channel('/b', STRING, full_definition(STRING), QOS))
        data = b'\x00\x01\x00\x00' + words.randbytes(words.randrange(40))
        channel = words.choice(kinds)
        writer.write(channel, time, data)
        written.append(('/a' if channel == kinds[0] else '/b', time, data))
        if time % 7 == 0:
            writer.save()
            assert read_ours(path) == written
    writer.close()
    assert read(path) == read_ours(path) == written


def test_a_file_cut_anywhere_keeps_the_chunks_before_the_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_writer, 'CHUNK_SIZE', 700)
    path, cut = tmp_path / 'a.mcap', tmp_path / 'cut.mcap'
    written = write_some(path)
    whole = path.read_bytes()
    counts = []
    for size in range(200, len(whole), 211):
        cut.write_bytes(whole[:size])
        found = read_ours(cut)
        assert found == written[: len(found)]
        assert BagReader(cut).breaks_off or found == written
        counts.append(len(found))
    assert counts == sorted(counts)
    assert (counts[0], counts[-1]) == (0, len(written))
    assert len(set(counts)) > 5


@for_all('tail', [-400, -1, 0, 1])
def test_damage_is_called_so_also_where_the_file_is_cut_or_longer(
    tail: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag_writer, 'CHUNK_SIZE', 700)
    path = tmp_path / 'a.mcap'
    written = write_some(path)
    whole = path.read_bytes()
    changed = (whole + b'\n')[: len(whole) + tail]
    path.write_bytes(changed)
    assert read_ours(path) == written
    assert not BagReader(path).breaks_off
    damaged = bytearray(changed)
    damaged[whole.index(written[30][2])] ^= 2
    path.write_bytes(damaged)
    with pytest.raises(RecordingError, match=r'a\.mcap: damaged \(crc'):
        read_ours(path)


def write_some(path: Path) -> list[tuple[str, int, bytes]]:
    """Write a hundred messages in several chunks; return them."""
    writer = BagWriter(path, {'robot': 'mbot'})
    channel = writer.add_channel('/a', STRING, full_definition(STRING), QOS)
    written = [('/a', time, b'\x00\x01\x00\x00' + bytes(time)) for time in range(100)]
    for _, time, data in written:
        writer.write(channel, time, data)
    writer.close()
    return written


def test_a_recording_without_a_message_opens(tmp_path: Path) -> None:
    BagWriter(tmp_path / 'empty.mcap', {}).close()
    assert read(tmp_path / 'empty.mcap') == []


def test_what_was_saved_survives_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'full.mcap'
    writer = BagWriter(path, {'robot': 'mbot'})
    channel = writer.add_channel('/a', STRING, full_definition(STRING), QOS)
    writer.write(channel, 1, b'\x00\x01\x00\x00before')
    writer.save()
    write = os.write

    room = [20]

    def nearly_full(file: int, data: bytes) -> int:
        if not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, data[: room.pop()])

    monkeypatch.setattr(os, 'write', nearly_full)
    writer.write(channel, 2, b'\x00\x01\x00\x00after')
    with pytest.raises(OutputError, match=r'full.mcap: No space left on device'):
        writer.save()
    assert read_ours(path) == [('/a', 1, b'\x00\x01\x00\x00before')]


def test_a_file_that_cannot_be_written_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match='--record .*: wanted a file in a folder that exists'):
        BagWriter(tmp_path / 'no' / 'where.mcap', {})


def test_latched_topics_are_recorded_as_latched(tmp_path: Path) -> None:
    write_some(tmp_path / 'a.mcap')
    reader = McapReader(tmp_path / 'a.mcap')
    reader.open()
    (profile,) = reader.connections[0].ext.offered_qos_profiles
    assert profile.durability == QosDurability.TRANSIENT_LOCAL
    reader.close()


@for_all(
    'kind',
    [
        'nav_msgs/msg/Odometry',
        'diagnostic_msgs/msg/DiagnosticArray',
        'geometry_msgs/msg/TwistStamped',
        'rosgraph_msgs/msg/Clock',
        'sensor_msgs/msg/PointCloud2',
        'trajectory_msgs/msg/JointTrajectory',
    ],
)
def test_a_definition_says_what_the_type_says(kind: str) -> None:
    types = get_types_from_msg(full_definition(kind), kind)
    assert kind in types
    for name, definition in types.items():
        # Constants and fields; rosbags knows them from its own copies.
        assert definition == store().fielddefs[name]


def test_a_type_without_a_definition_is_said_in_one_line() -> None:
    with pytest.raises(UserError, match='Odometer.msg: No such file'):
        full_definition('nav_msgs/msg/Odometer')


def messages() -> list[object]:
    """Return messages with gaps and empty sequences of every kind."""
    odometry = Odometry(child_frame_id='base')
    odometry.header.frame_id = 'odom'
    odometry.twist.twist.angular.z = 0.5
    joints = JointState(name=['a', 'bcd', 'ef'], position=[1.0, 2.0, 3.0])
    contacts = JointState(name=['foot'], effort=[4.0, 5.0])
    array = DiagnosticArray(status=[DiagnosticStatus(name='x\u00e4', level=b'\x01')] * 2)
    # What is of one length begins at any place, also where it is known from before.
    frames = TFMessage(transforms=2 * [TransformStamped(child_frame_id=n * 'x') for n in range(9)])
    return [odometry, joints, contacts, JointState(), array, Time(sec=3), frames]


@pytest.mark.slow
@for_all('message', messages())
def test_a_message_ends_where_its_fields_end(message: object) -> None:
    data = to_bytes(message)
    assert deserialize_message(data, type(message)) == message
    # rosbags serialises by itself, and refuses what is too long.
    package, interface, *_ = type(message).__module__.split('.')
    name = f'{package}/{interface}/{type(message).__name__}'
    assert len(data) == len(store().serialize_cdr(store().deserialize_cdr(data, name), name))
