# SPDX-License-Identifier: Apache-2.0
"""Reads a recording: what run it is of, its topics, its messages."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader

from wasd_bringup.errors import RecordingError
from wasd_bringup.recorded_run import RECORD_NAME


class Topic(NamedTuple):
    """A topic of a recording: its full name, its type, how many messages it has."""

    name: str
    kind: str
    messages: int


class RecordedMessage(NamedTuple):
    """A message as CDR, and when it was published [ns of simulated time]."""

    topic: str
    time: int
    data: bytes


class BagReader:
    """
    An MCAP file that `--record` wrote.

    `run` is what `describe_run` said of it; `start` and `end` are the times of the first and the
    last message [ns].
    """

    def __init__(self, path: Path) -> None:
        """
        Open a recording and read its index.

        Raises:
            RecordingError: it cannot be read, or is not of `wasd`.
        """
        self.path = path
        try:
            self._reader: Any = make_reader(path.open('rb'))
            summary: Any = self._reader.get_summary()
            metadata = {one.name: one.metadata for one in self._reader.iter_metadata()}
            counts = summary.statistics.channel_message_counts
            self.topics = [
                Topic(one.topic, summary.schemas[one.schema_id].name, int(counts.get(key, 0)))
                for key, one in sorted(summary.channels.items(), key=lambda item: item[1].topic)
            ]
            self.start = int(summary.statistics.message_start_time)
            self.end = int(summary.statistics.message_end_time)
        except OSError as error:
            raise RecordingError(f'{path}: {error.strerror}') from None
        except Exception as error:  # mcap raises whatever a wrong byte leads to
            raise RecordingError(f'{path}: no MCAP recording ({_reason(error)})') from None
        if RECORD_NAME not in metadata:
            raise RecordingError(f'{path}: not recorded by `wasd ... --record`')
        self.run: dict[str, str] = metadata[RECORD_NAME]

    def messages(self, topics: Collection[str]) -> Iterator[RecordedMessage]:
        """
        Yield the messages of some topics in the order in which they were published.

        Raises:
            RecordingError: the file is damaged.
        """
        try:
            for _, channel, message in self._reader.iter_messages(topics=list(topics)):
                yield RecordedMessage(channel.topic, message.log_time, message.data)
        except Exception as error:
            raise RecordingError(f'{self.path}: damaged ({_reason(error)})') from None


def _reason(error: Exception) -> str:
    return ' '.join(str(error).split()) or type(error).__name__
