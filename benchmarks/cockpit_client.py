# SPDX-License-Identifier: Apache-2.0
"""
A browser of a page in a process of its own: panels and scene, sixty pictures a second.

`python cockpit_client.py URL` says `open` with its first panels; when its standard input ends it
says how many bytes a second came for panels and for the scene.
"""

import contextlib
from pathlib import Path
import sys
import threading
import time

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))
from page_puppet import PagePuppet
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

RATE, DESK = 60.0, (1280, 720)


class Scene:
    """Takes what shows the scene, as fast as it comes."""

    def __init__(self, url: str, session: str) -> None:
        self.received = 0
        self._stack = contextlib.ExitStack()
        address = f'{url.replace("http", "ws", 1)}state?sid={session}'
        self._socket = self._stack.enter_context(connect(address, max_size=None))
        self._thread = threading.Thread(target=self._take, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take no more."""
        self._stack.close()

    def _take(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                message = self._socket.recv()
                if isinstance(message, bytes):
                    self.received += len(message)
                    self._socket.send('state_ack')


def main() -> None:
    """Be a browser until the standard input ends."""
    url = sys.argv[1]
    with PagePuppet(url, RATE, size=DESK) as page:
        scene = Scene(url, 'puppet')
        while page.frames < 3:
            time.sleep(0.01)
        print('open', flush=True)
        since, panels, before = time.monotonic(), page.received, scene.received
        sys.stdin.read()
        took = time.monotonic() - since
        print((page.received - panels) / took, (scene.received - before) / took, flush=True)
        scene.close()


if __name__ == '__main__':
    main()
