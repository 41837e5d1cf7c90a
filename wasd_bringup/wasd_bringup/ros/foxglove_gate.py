# SPDX-License-Identifier: Apache-2.0
"""
The access check of `--foxglove`: for Foxglove and programs of this machine only.

Foxglove's library serves every page and does not say where a page is from. So it serves at a
secret address of this machine, and the gate forwards allowed connections there.
"""

from collections import OrderedDict
from collections.abc import Callable
import contextlib
import re
import secrets
import socket
import threading

from wasd_core.network import LOOPBACK

# Pages that may drive: of this machine, of Foxglove, and its application (a page without a host).
_HERE = r'(?:localhost|127\.0\.0\.1)(?::\d{1,5})?'
HOSTS = re.compile(_HERE, re.IGNORECASE)
ORIGINS = re.compile(rf'https?://{_HERE}|https://(?:[a-z0-9-]+\.)*foxglove\.dev|file://', re.I)
# A client has so long for its request [s], which is no longer than this.
HEADER_TIMEOUT = 5.0
LONGEST_HEADER = 16384
MOST_CLIENTS = 64
_AT_ONCE = 1 << 16
_FORBIDDEN = b'HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n'


def secret_host() -> str:
    """Return an address of this machine that nobody can guess."""
    return '127.' + '.'.join(str(1 + secrets.randbelow(254)) for _ in range(3))


class Gate:
    """Listens on a port of this machine, 0 for any, and leads those that may pass to `inner`."""

    def __init__(self, port: int, inner: tuple[str, int], say: Callable[[str], None]) -> None:
        """
        Begin to listen; `say` hears, in a thread of ours, of a page that was refused.

        Raises:
            OSError: the port is taken.
        """
        self._listener = socket.create_server((LOOPBACK, port), backlog=MOST_CLIENTS)
        self.port: int = self._listener.getsockname()[1]
        self._inner, self._say = inner, say
        self._open: set[socket.socket] = set()
        self._asking: OrderedDict[socket.socket, bool] = OrderedDict()  # without a request yet
        self._places = threading.BoundedSemaphore(MOST_CLIENTS)
        _start(self._listen)

    def close(self) -> None:
        """Accept no more connections, and close all."""
        for one in (self._listener, *tuple(self._open)):
            _end(one)
            one.close()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                if self._places.acquire(blocking=False) or self._make_room():
                    self._asking[client] = True
                    _start(self._lead, client)
                else:
                    client.close()

    def _make_room(self) -> bool:
        """Take the place of the client that has not asked for anything for longest."""
        with contextlib.suppress(KeyError):  # all have
            _end(self._asking.popitem(last=False)[0])
            return self._places.acquire(timeout=HEADER_TIMEOUT)
        return False

    def _lead(self, client: socket.socket) -> None:
        """Look at a client's request, then pass on what both sides say until one has ended."""
        try:
            with client, contextlib.suppress(OSError):
                self._open.add(client)
                client.settimeout(HEADER_TIMEOUT)
                request = _read_header(client)
                if not self._asking.pop(client, False):
                    return
                stranger = who_may_not(request)
                if stranger is not None:
                    self._say(stranger)
                    client.sendall(_FORBIDDEN)
                    return
                client.settimeout(None)
                with socket.create_connection(self._inner) as server:
                    self._open.add(server)
                    for one in (client, server):  # small messages do not wait for more
                        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    server.sendall(request)
                    back = _start(_pass_on, server, client)
                    _pass_on(client, server)
                    back.join()
                    self._open.discard(server)
        finally:
            self._asking.pop(client, None)
            self._open.discard(client)
            self._places.release()


def who_may_not(request: bytes) -> str | None:
    """Return whose page makes a request that may not pass; '' for no page, None if it may."""
    if not request:
        return ''
    lines = request.decode('latin-1').split('\r\n')[1:]
    pairs = [line.partition(':')[::2] for line in lines]
    hosts, origins = (
        [value.strip() for name, value in pairs if name.strip().lower() == wanted]
        for wanted in ('host', 'origin')
    )
    if len(hosts) != 1 or not HOSTS.fullmatch(hosts[0]):
        return (origins or hosts or [''])[0]
    if len(origins) > 1 or (origins and not ORIGINS.fullmatch(origins[0])):
        return origins[0]
    return None


def _read_header(client: socket.socket) -> bytes:
    """Return a client's first bytes, with its whole header; nothing if it sends none."""
    data = b''
    while b'\r\n\r\n' not in data:
        more = client.recv(LONGEST_HEADER)
        data += more
        if not more or len(data) > LONGEST_HEADER:
            return b''
    return data


def _pass_on(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(_AT_ONCE):
            sink.sendall(data)
    _end(source)
    _end(sink)


def _end(one: socket.socket) -> None:
    """Shut a socket down, so that the thread that waits for it ends."""
    with contextlib.suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)


def _start(act: Callable[..., None], *arguments: socket.socket) -> threading.Thread:
    thread = threading.Thread(target=act, args=arguments, daemon=True)
    thread.start()
    return thread
