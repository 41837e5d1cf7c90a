# SPDX-License-Identifier: Apache-2.0
"""A client of Foxglove's WebSocket, as its app is one: subscribes, publishes, keeps what comes."""

import contextlib
import json
import struct
import time
from typing import Any

from websockets.sync.client import connect

SUBPROTOCOL = 'foxglove.sdk.v1'
MESSAGE, TIME = 1, 2


class FoxgloveClient:
    """One connection; `take` reads what has come, and nothing waits longer than it says."""

    def __init__(self, port: int, origin: Any = None) -> None:
        self._open = contextlib.ExitStack()
        self._socket = self._open.enter_context(
            connect(
                f'ws://127.0.0.1:{port}',
                origin=origin,
                subprotocols=[SUBPROTOCOL],
                max_size=None,
                close_timeout=0.2,  # a server that has ended says no goodbye
            )
        )
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[bytes]] = {}
        self.complaints: list[str] = []
        self.time = 0
        self._topics: dict[int, str] = {}
        self._sent: dict[tuple[str, str, str], int] = {}

    def take(self, timeout: float = 0.0) -> None:
        """Read what has come, waiting so long [s] for the first."""
        deadline = time.monotonic() + timeout
        with contextlib.suppress(TimeoutError):
            while True:
                self._on(self._socket.recv(timeout=max(deadline - time.monotonic(), 0.0)))

    def subscribe(self, *topics: str) -> None:
        """Follow topics that were advertised."""
        rows = []
        for topic in topics:
            number = len(self._topics)
            self._topics[number] = topic
            rows.append({'id': number, 'channelId': self.channels[topic]['id']})
        self._socket.send(json.dumps({'op': 'subscribe', 'subscriptions': rows}))

    def publish(self, topic: str, schema: str, data: bytes | dict[str, Any]) -> None:
        """Publish CDR, or fields as JSON."""
        encoding = 'json' if isinstance(data, dict) else 'cdr'
        sent = topic, schema, encoding
        if sent not in self._sent:
            self._sent[sent] = len(self._sent) + 1
            row = {'id': self._sent[sent], 'topic': topic, 'encoding': encoding}
            row['schemaName'] = schema
            self._socket.send(json.dumps({'op': 'advertise', 'channels': [row]}))
        text = json.dumps(data).encode() if isinstance(data, dict) else data
        self._socket.send(struct.pack('<BI', MESSAGE, self._sent[sent]) + text)

    def vanish(self) -> None:
        """Be gone without a word, as a process that is killed."""
        self._socket.socket.close()

    def close(self) -> None:
        """Say goodbye."""
        self._open.close()

    def _on(self, said: str | bytes) -> None:
        if isinstance(said, str):
            told = json.loads(said)
            if told['op'] == 'serverInfo':
                self.info = told
            elif told['op'] == 'advertise':
                self.channels |= {channel['topic']: channel for channel in told['channels']}
            elif told['op'] == 'status':
                self.complaints.append(told['message'])
        elif said[0] == TIME:
            (self.time,) = struct.unpack('<Q', said[1:9])
        elif said[0] == MESSAGE:
            number, _ = struct.unpack('<IQ', said[1:13])
            self.messages.setdefault(self._topics[number], []).append(said[13:])
