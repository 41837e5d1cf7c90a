# SPDX-License-Identifier: Apache-2.0
"""Who passes the door of `--foxglove`: Foxglove and programs, but no page of somebody else."""

import contextlib
import queue
import socket
import threading

from cases import for_all
import pytest
from terminals import PATIENCE
from wasd_bringup.ros import foxglove_gate
from wasd_bringup.ros.foxglove_gate import Gate, who_may_not

MINE = ('Host: localhost:8765',)


def request(*lines):
    """Return a request with these lines of a header."""
    return '\r\n'.join(('GET / HTTP/1.1', *lines, '', '')).encode()


@for_all(
    'lines',
    [
        MINE,
        ('host:127.0.0.1',),
        (*MINE, 'Origin: https://app.foxglove.dev'),
        (*MINE, 'origin: file://'),
        (*MINE, 'Origin: http://localhost:8080'),
        (*MINE, 'ORIGIN: http://127.0.0.1:5173'),
    ],
)
def test_foxglove_this_machine_and_programs_may_pass(lines):
    assert who_may_not(request(*lines)) is None


@for_all(
    ('lines', 'who'),
    [
        ((*MINE, 'Origin: https://evil.example'), 'https://evil.example'),
        ((*MINE, 'Origin: null'), 'null'),
        (
            (*MINE, 'Origin: https://foxglove.dev.evil.example'),
            'https://foxglove.dev.evil.example',
        ),
        ((*MINE, 'Origin: https://evilfoxglove.dev'), 'https://evilfoxglove.dev'),
        ((*MINE, 'Origin: http://localhost.evil.example'), 'http://localhost.evil.example'),
        ((*MINE, 'Origin: https://app.foxglove.dev', 'Origin: null'), 'https://app.foxglove.dev'),
        (('Host: evil.example:8765',), 'evil.example:8765'),
        (('Host: evil.example', 'Origin: file://'), 'file://'),
        ((*MINE, *MINE), 'localhost:8765'),
        ((), ''),
    ],
)
def test_pages_of_others_may_not(lines, who):
    assert who_may_not(request(*lines)) == who


class Echo:
    """A server that says what it hears."""

    def __init__(self):
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.address = self._listener.getsockname()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                threading.Thread(target=self._answer, args=(client,), daemon=True).start()

    @staticmethod
    def _answer(client):
        with client, contextlib.suppress(OSError):
            while data := client.recv(1 << 16):
                client.sendall(data)

    def close(self):
        self._listener.close()


@pytest.fixture
def echo():
    made = Echo()
    yield made
    made.close()


@pytest.fixture
def refused():
    return queue.SimpleQueue()


@pytest.fixture
def gate(echo, refused):
    made = Gate(0, echo.address, refused.put)
    yield made
    made.close()


def said(client, count):
    """Return so many bytes that a socket says, or what it says until it ends."""
    found = b''
    while len(found) < count and (more := client.recv(count - len(found))):
        found += more
    return found


def connect(gate):
    return socket.create_connection(('127.0.0.1', gate.port), timeout=PATIENCE)


@pytest.mark.slow
def test_all_that_is_said_passes_in_both_directions(gate):
    first, rest = request(*MINE) + b'and', bytes(range(256)) * 20_000
    with connect(gate) as client:
        client.sendall(first)
        assert said(client, len(first)) == first
        sender = threading.Thread(target=client.sendall, args=(rest,))
        sender.start()
        assert said(client, len(rest)) == rest
        sender.join()


@pytest.mark.slow
def test_who_is_refused_is_told_so_and_named(gate, refused):
    with connect(gate) as client:
        client.sendall(request(*MINE, 'Origin: https://evil.example'))
        assert said(client, 1000).startswith(b'HTTP/1.1 403')
    assert refused.get(timeout=PATIENCE) == 'https://evil.example'


@pytest.mark.slow
@pytest.mark.parametrize('begin', [b'', b'GET / HTTP/1.1\r\nX-Slow: ', b'a' * 20_000])
def test_who_does_not_ask_for_anything_is_let_go(gate, monkeypatch, begin):
    monkeypatch.setattr(foxglove_gate, 'HEADER_TIMEOUT', 0.05)
    with connect(gate) as client, contextlib.suppress(ConnectionResetError):
        client.sendall(begin)
        assert said(client, 1000) in (b'', foxglove_gate._FORBIDDEN)


@pytest.mark.slow
def test_clients_that_say_nothing_make_room_for_one_that_asks(gate, monkeypatch):
    monkeypatch.setattr(foxglove_gate, 'HEADER_TIMEOUT', 10.0 * PATIENCE)
    with contextlib.ExitStack() as stack:
        first = stack.enter_context(connect(gate))
        first.sendall(request(*MINE))
        assert said(first, 5) == b'GET /'
        for _ in range(2 * foxglove_gate.MOST_CLIENTS):
            stack.enter_context(connect(gate))
        client = stack.enter_context(connect(gate))
        client.sendall(request(*MINE))
        assert said(client, 5) == b'GET /'
        said(first, len(request(*MINE)) - 5)
        first.sendall(b'on')
        assert said(first, 2) == b'on'


@pytest.mark.slow
def test_an_end_of_either_side_is_the_end_of_both(gate, echo):
    with connect(gate) as client:
        client.sendall(request(*MINE))
        assert said(client, 5) == b'GET /'
        gate.close()
        with contextlib.suppress(ConnectionResetError):
            said(client, 1 << 20)  # ends
