# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file that is complete at any time, also while it is being written."""

from collections.abc import Iterable, Iterator, Mapping
import contextlib
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from wasd_core.errors import UserError
from wasd_core.output_file import OutputError, OutputFile

MAGIC = b'\x89MCAP0\r\n'
LIBRARY = 'wasd'
# Name of the metadata record that says what run it is of.
RECORD_NAME = 'wasd'
# A chunk ends when it has grown over this many bytes.
CHUNK_SIZE = 512 * 1024


class RecordingError(UserError):
    """A recording cannot be written or read; the text is one line with its path."""


class BagWriter:
    """
    A recording in ROS 2's MCAP profile: schemas as `ros2msg`, messages as CDR, chunks, indexes.

    MCAP has its index at the end. `save` writes the messages so far *and* the end behind them;
    the next `save` writes over that end. So whoever is killed in between leaves a file that any
    reader opens. The bytes of the closed file do not depend on when `save` was called. Into a pipe
    or a device go whole chunks, and the end once.
    """

    def __init__(self, file: Path | OutputFile, metadata: Mapping[str, str]) -> None:
        """
        Begin a file; an existing one is replaced by the first save. `metadata` describes the run.

        Raises:
            RecordingError: it cannot be written.
        """
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: dict[int, int] = {}
        # Of each finished chunk its index, as it goes into the file, and its span of time.
        self._chunks: list[bytes] = []
        self._span: tuple[int, int] | None = None
        self._chunk = _OpenChunk()
        self._saved_end = b''
        self._is_changed = True
        head = MAGIC + _to_bytes(Header(profile='ros2', library=LIBRARY))
        record = _to_bytes(Metadata(name=RECORD_NAME, metadata=dict(metadata)))
        self._metadata = MetadataIndex(offset=len(head), length=len(record), name=RECORD_NAME)
        # Where what has not been saved for good goes: finished chunks, then the end of the file.
        self._position = 0
        self._finished = head + record
        self._has_begun = False
        with _as_recording_error():
            self._file = OutputFile(file, '--record') if isinstance(file, Path) else file

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
        if not self._file.is_regular:
            self._send_finished()
            return
        position = self._position + len(self._finished)
        data, index = self._chunk.close(position)
        end = self._end(position + len(data), index)
        try:
            with _as_recording_error():
                self._put(self._finished + data + end)
        except RecordingError:
            self._restore()
            raise
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
            if not self._file.is_regular:
                self._send_end()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is on disk."""
        with contextlib.suppress(OutputError):
            self._file.close()

    def _send_finished(self) -> None:
        """Send what will not change any more down a pipe."""
        data, self._finished = self._finished, b''
        self._position += len(data)
        with _as_recording_error():
            self._file.append(data)

    def _send_end(self) -> None:
        data, index = self._chunk.close(self._position)
        with _as_recording_error():
            self._file.append(data + self._end(self._position + len(data), index))

    def _finish_chunk(self) -> None:
        position = self._position + len(self._finished)
        data, index = self._chunk.close(position)
        assert index is not None
        self._finished += data
        self._span = self._span_with(index)
        self._chunks.append(_to_bytes(index))
        self._chunk = _OpenChunk()

    def _put(self, data: bytes) -> None:
        """Write from the position on where the last save began to change."""
        if self._has_begun:
            self._file.put(data, self._position)
        else:
            self._file.begin(data)
        self._has_begun = True

    def _restore(self) -> None:
        """Put the last complete end back over what was half written: its blocks are there."""
        with contextlib.suppress(OutputError):
            if self._has_begun:
                self._file.put(self._saved_end, self._position)
                self._file.truncate(self._position + len(self._saved_end))

    def _end(self, position: int, last: ChunkIndex | None) -> bytes:
        """
        Return what closes a file whose messages end at a position: index and statistics.

        `last` is the chunk that is still growing.
        """
        chunks = self._chunks if last is None else [*self._chunks, _to_bytes(last)]
        head = _to_bytes(DataEnd(data_section_crc=0))
        start = position + len(head)
        statistics = self._statistics(len(chunks), self._span_with(last))
        groups: list[tuple[Opcode, Iterable[bytes]]] = [
            (Opcode.SCHEMA, map(_to_bytes, self._schemas.values())),
            (Opcode.CHANNEL, map(_to_bytes, self._channels.values())),
            (Opcode.STATISTICS, [_to_bytes(statistics)]),
            (Opcode.CHUNK_INDEX, chunks),
            (Opcode.METADATA_INDEX, [_to_bytes(self._metadata)]),
        ]
        summary, offsets = b'', b''
        for opcode, records in groups:
            group = b''.join(records)
            if group:
                offsets += _to_bytes(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        footer = Footer(start, start + len(summary), summary_crc=0)
        return head + summary + offsets + _to_bytes(footer) + MAGIC

    def _span_with(self, chunk: ChunkIndex | None) -> tuple[int, int] | None:
        """Return the first and last time [ns] of all finished chunks and of one more."""
        if chunk is None:
            return self._span
        start, end = chunk.message_start_time, chunk.message_end_time
        if self._span is None:
            return start, end
        return min(start, self._span[0]), max(end, self._span[1])

    def _statistics(self, chunks: int, span: tuple[int, int] | None) -> Statistics:
        start, end = span or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=chunks,
            message_count=sum(self._counts.values()),
            message_start_time=start,
            message_end_time=end,
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
        data = _to_bytes(record)
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
        data = _to_bytes(chunk)
        offsets, indexes = {}, b''
        for channel, index in self._indexes.items():
            offsets[channel] = position + len(data) + len(indexes)
            indexes += _to_bytes(index)
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


@contextlib.contextmanager
def _as_recording_error() -> Iterator[None]:
    try:
        yield
    except OutputError as error:
        raise RecordingError(str(error)) from None


def _to_bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
