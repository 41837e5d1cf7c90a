# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file in small chunks, so that a file that breaks off keeps all whole ones."""

from collections.abc import Mapping
import contextlib
from pathlib import Path

from mcap.writer import CompressionType, Writer
from wasd_core.output_file import OutputError, OutputFile

LIBRARY = 'wasd'
# Name of the metadata record that says what run it is of.
RECORD_NAME = 'wasd'
# A chunk ends when it has grown over this many bytes.
CHUNK_SIZE = 512 * 1024


class _Unsaved:
    """A stream that keeps what the file does not have yet; `tell` counts from its beginning."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._taken = 0

    def write(self, data: bytes) -> None:
        self.data += data

    def tell(self) -> int:
        return self._taken + len(self.data)

    def flush(self) -> None:
        """Do nothing: `take` is what empties it."""

    def take(self) -> bytes:
        data = bytes(self.data)
        self._taken += len(data)
        self.data.clear()
        return data


class BagWriter:
    """
    A recording in ROS 2's MCAP profile: schemas as `ros2msg`, messages as CDR, chunks, indexes.

    `save` ends the chunk, `close` adds the index. A run that is killed leaves a file without one,
    of which every saved message can be read.
    """

    def __init__(self, file: Path | OutputFile, metadata: Mapping[str, str]) -> None:
        """
        Begin a file; an existing one is replaced by the first save. `metadata` describes the run.

        Raises:
            OutputError: it cannot be written.
        """
        self._schemas: dict[str, int] = {}
        self._unsaved = _Unsaved()
        self._writer = new_writer(self._unsaved)
        self._writer.add_metadata(RECORD_NAME, dict(metadata))
        self._has_begun = False
        self._file = OutputFile(file, '--record') if isinstance(file, Path) else file

    def add_channel(self, topic: str, kind: str, definition: str, qos: str) -> int:
        """Declare a topic; return the number to `write` its messages with."""
        if kind not in self._schemas:
            data = definition.encode()
            self._schemas[kind] = self._writer.register_schema(kind, 'ros2msg', data)
        metadata = {'offered_qos_profiles': qos}
        return self._writer.register_channel(topic, 'cdr', self._schemas[kind], metadata)

    def write(self, channel: int, time: int, data: bytes) -> None:
        """
        Add a message, serialised as CDR, at a time [ns] not before the last one.

        Raises:
            OutputError: a full chunk could not be written.
        """
        self._writer.add_message(channel, time, data, publish_time=time)
        if len(self._unsaved.data) > CHUNK_SIZE:
            self._put()

    def save(self) -> None:
        """
        Bring everything up to now into the file.

        Raises:
            OutputError: the disk is full, or the like; what was saved before stays readable.
        """
        self._writer.flush()
        self._put()

    def close(self) -> None:
        """
        Save, add the index, and close.

        Raises:
            OutputError: as `save`.
        """
        try:
            self._writer.finish()
            self._put()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is on disk."""
        with contextlib.suppress(OutputError):
            self._file.close()

    def _put(self) -> None:
        put = self._file.append if self._has_begun else self._file.begin
        put(self._unsaved.take())
        self._has_begun = True


def new_writer(stream: object) -> Writer:
    """Begin ROS 2's profile in a stream, without compression."""
    writer = Writer(stream, chunk_size=CHUNK_SIZE, compression=CompressionType.NONE)  # type: ignore[arg-type]
    writer.start('ros2', LIBRARY)
    return writer
