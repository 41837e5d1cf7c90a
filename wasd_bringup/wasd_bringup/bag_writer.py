# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file that is complete at any time, also while it is being written."""

from collections.abc import Mapping
import os
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import ChunkIndex
from mcap.records import DataEnd
from mcap.records import Footer
from mcap.records import Header
from mcap.records import McapRecord
from mcap.records import Message
from mcap.records import MessageIndex
from mcap.records import Metadata
from mcap.records import MetadataIndex
from mcap.records import Schema
from mcap.records import Statistics
from mcap.records import SummaryOffset

from wasd_bringup.errors import RecordingError
from wasd_bringup.recorded_run import RECORD_NAME

MAGIC = b'\x89MCAP0\r\n'
LIBRARY = 'wasd'
# A chunk ends when it has grown over this many bytes.
CHUNK_SIZE = 512 * 1024


class BagWriter:
    """
    A recording in ROS 2's MCAP profile: schemas as `ros2msg`, messages as CDR, chunks, indexes.

    MCAP has its index at the end. `save` writes the messages so far *and* the end behind them;
    the next `save` writes over that end. So whoever is killed in between leaves a file that any
    reader opens. The bytes of the closed file do not depend on when `save` was called.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        """
        Begin a file; an existing one is replaced. `metadata` describes the run.

        Raises:
            RecordingError: it cannot be written.
        """
        self._path = path
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._chunk = _OpenChunk()
        self._saved_end = b''
        self._is_changed = True
        head = MAGIC + _encoded(Header(profile='ros2', library=LIBRARY))
        record = _encoded(Metadata(name=RECORD_NAME, metadata=dict(metadata)))
        self._metadata = MetadataIndex(offset=len(head), length=len(record), name=RECORD_NAME)
        # Where what has not been saved for good goes: finished chunks, then the end of the file.
        self._position = 0
        self._finished = head + record
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        except OSError as error:
            raise RecordingError(f'{path}: {error.strerror}') from None
        self.save()

    def add_channel(self, topic: str, kind: str, definition: str, qos: str) -> int:
        """Declare a topic; return the number to `write` its messages with."""
        if kind not in self._schemas:
            schema = Schema(
                id=len(self._schemas) + 1, name=kind, encoding='ros2msg', data=definition.encode()
            )
            self._schemas[kind] = schema
            self._chunk.add(schema)
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding='cdr',
            schema_id=self._schemas[kind].id,
            metadata={'offered_qos_profiles': qos},
        )
        self._channels[channel.id] = channel
        self._counts[channel.id] = 0
        self._chunk.add(channel)
        self._is_changed = True
        return channel.id

    def write(self, channel: int, time: int, data: bytes) -> None:
        """
        Add a message, serialised as CDR, at a time [ns] not before the last one.

        Raises:
            RecordingError: a full chunk could not be written.
        """
        self._chunk.add_message(channel, self._counts[channel], time, data)
        self._counts[channel] += 1
        self._is_changed = True
        if self._chunk.size > CHUNK_SIZE:
            self._finish_chunk()
            self.save()

    def save(self) -> None:
        """
        Make the file complete up to now.

        Raises:
            RecordingError: the disk is full, or the like; what was saved before stays readable.
        """
        if not self._is_changed:
            return
        position = self._position + len(self._finished)
        data, index = self._chunk.close(position)
        end = self._end(position + len(data), [*self._chunks, *([index] if index else [])])
        try:
            self._put(self._finished + data + end, self._position)
        except OSError as error:
            self._restore()
            raise RecordingError(f'{self._path}: {error.strerror}') from None
        self._position, self._finished = position, b''
        self._saved_end = data + end
        self._is_changed = False

    def close(self) -> None:
        """
        Save and close.

        Raises:
            RecordingError: as `save`.
        """
        try:
            self.save()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is on disk."""
        os.close(self._file)

    def _finish_chunk(self) -> None:
        position = self._position + len(self._finished)
        data, index = self._chunk.close(position)
        assert index is not None
        self._finished += data
        self._chunks.append(index)
        self._chunk = _OpenChunk()

    def _put(self, data: bytes, position: int) -> None:
        view = memoryview(data)
        while view:
            count = os.pwrite(self._file, view, position)
            view, position = view[count:], position + count

    def _restore(self) -> None:
        """Put the last complete end back over what was half written: its blocks are there."""
        try:
            self._put(self._saved_end, self._position)
            os.ftruncate(self._file, self._position + len(self._saved_end))
        except OSError:
            pass

    def _end(self, position: int, chunks: list[ChunkIndex]) -> bytes:
        """Return what closes a file whose messages end at a position: index and statistics."""
        head = _encoded(DataEnd(data_section_crc=0))
        start = position + len(head)
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [self._statistics(chunks)]),
            (Opcode.CHUNK_INDEX, list(chunks)),
            (Opcode.METADATA_INDEX, [self._metadata]),
        ]
        summary, offsets = b'', b''
        for opcode, records in groups:
            group = b''.join(map(_encoded, records))
            if group:
                offsets += _encoded(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        footer = Footer(start, start + len(summary), summary_crc=0)
        return head + summary + offsets + _encoded(footer) + MAGIC

    def _statistics(self, chunks: list[ChunkIndex]) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(chunks),
            message_count=sum(self._counts.values()),
            message_start_time=min((chunk.message_start_time for chunk in chunks), default=0),
            message_end_time=max((chunk.message_end_time for chunk in chunks), default=0),
            metadata_count=1,
            schema_count=len(self._schemas),
        )


class _OpenChunk:
    """Records that share one chunk, and where the messages among them are."""

    def __init__(self) -> None:
        self._records: list[bytes] = []
        self._indexes: dict[int, MessageIndex] = {}
        self.size = 0

    def add(self, record: McapRecord) -> None:
        data = _encoded(record)
        self._records.append(data)
        self.size += len(data)

    def add_message(self, channel: int, sequence: int, time: int, data: bytes) -> None:
        index = self._indexes.setdefault(channel, MessageIndex(channel_id=channel, records=[]))
        index.records.append((time, self.size))
        self.add(Message(channel, time, data, time, sequence))

    def close(self, position: int) -> tuple[bytes, ChunkIndex | None]:
        """Return the bytes of the chunk and its indexes at a position in the file."""
        times = [time for index in self._indexes.values() for time, _ in index.records]
        if not times:
            # A chunk needs messages: definitions alone stand for themselves.
            return b''.join(self._records), None
        chunk = Chunk('', b''.join(self._records), max(times), min(times), 0, self.size)
        data = _encoded(chunk)
        offsets, indexes = {}, b''
        for channel, index in self._indexes.items():
            offsets[channel] = position + len(data) + len(indexes)
            indexes += _encoded(index)
        summary = ChunkIndex(
            chunk_length=len(data),
            chunk_start_offset=position,
            compression='',
            compressed_size=self.size,
            message_end_time=max(times),
            message_index_length=len(indexes),
            message_index_offsets=offsets,
            message_start_time=min(times),
            uncompressed_size=self.size,
        )
        return data + indexes, summary


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
