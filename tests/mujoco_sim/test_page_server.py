# SPDX-License-Identifier: Apache-2.0
"""The page's server is for this page: other people's pages, big files and slow clients are not."""

import asyncio
from collections.abc import Iterator
import contextlib
import ctypes
import gc
import http.client
from pathlib import Path
import socket
import threading
import time

from cases import for_all
from mujoco.studio import messages
from mujoco.studio.web import web_server
from mujoco_sim.viewer import server as page_server
from mujoco_sim.viewer import turns
from mujoco_sim.viewer.drawing import Panel
from mujoco_sim.viewer.page import CameraView, WebView
from mujoco_sim.world import build_world
import numpy as np
from page_puppet import code, input_packet, PagePuppet, VERSION_PACKET
import pytest
from terminals import PATIENCE, wait_until
from websockets.exceptions import ConnectionClosed, ConnectionClosedOK, InvalidStatus
from websockets.sync.client import ClientConnection, connect

SOCKETS = ('/ui', '/state', '/drop', '/e_stop')
PATHS = ('/', '/status', *SOCKETS, '/model', '/web_client.js', '/nothing')
CAMERA = CameraView(distance=1.0, azimuth=90.0, elevation=-20.0)


class Status:
    """The words of the page's panel, which can be made to fail."""

    fails = False

    def __call__(self) -> list[str]:
        """Return them."""
        if self.fails:
            raise ZeroDivisionError('of the test')
        return ['status']


STATUS = Status()


@pytest.fixture(scope='session')
def view(loaded) -> Iterator[WebView]:
    """Return a page of mbot; Studio has one for a process."""
    view = WebView(build_world(loaded), CAMERA, Panel(STATUS, ['help']))
    view.sync()
    view.input.can_stop = True
    yield view
    view.close()


@pytest.fixture
def port(view: WebView) -> int:
    """Return its port."""
    return int(view.url.rsplit(':', 1)[1].strip('/'))


def get(port: int, path: str, **headers: str) -> http.client.HTTPResponse:
    """Ask for a path with headers, of which Host may be one."""
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    connection.putrequest('GET', path, skip_host='Host' in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    answer.read()
    return answer


def upgrade(port: int, path: str, **headers: str) -> http.client.HTTPResponse:
    """Ask for a path as a WebSocket does."""
    words = {'Connection': 'Upgrade', 'Upgrade': 'websocket', 'Sec-WebSocket-Version': '13'}
    return get(port, path, **words, **{'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ=='}, **headers)


def roles(state: ClientConnection, seconds: float) -> list[str]:
    """Return the roles that the server tells a browser of, for some seconds."""
    found, deadline = [], time.monotonic() + seconds
    while time.monotonic() < deadline:
        with contextlib.suppress(TimeoutError):
            message = state.recv(timeout=0.1)
            if isinstance(message, str):
                found += [word[5:] for word in message.split(';') if word.startswith('role=')]
    return found


def resident() -> int:
    """Return this process's resident memory [bytes], without what is free or garbage."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path('/proc/self/statm').read_text().split()[1]) * 4096


@for_all('path', PATHS)
@for_all('origin', ['http://evil.example.com', 'null', 'http://127.0.0.1:1', ''])
def test_a_page_of_somebody_else_gets_nothing(port, path, origin):
    assert get(port, path, Origin=origin).status == 403
    assert upgrade(port, path, Origin=origin).status == 403


@for_all('path', PATHS)
@for_all('host', ['evil.example.com', 'evil.example.com:{port}', '127.0.0.1', ''])
def test_a_name_that_was_made_to_lead_here_gets_nothing(port, path, host):
    assert get(port, path, Host=host.format(port=port)).status == 403
    assert upgrade(port, path, Host=host.format(port=port)).status == 403


@pytest.mark.parametrize('name', ['127.0.0.1', 'localhost'])
def test_the_page_itself_gets_everything(port, name):
    own = {'Host': f'{name}:{port}', 'Origin': f'http://{name}:{port}'}
    assert [get(port, path, **own).status for path in ('/', '/model', '/web_client.js')] == 3 * [
        200
    ]
    assert get(port, '/', Host=own['Host']).status == 200
    assert [upgrade(port, path, **own).status for path in SOCKETS] == [101, 101, 403, 101]


@pytest.mark.parametrize('name', ['127.0.0.1', 'localhost'])
def test_a_browser_leaves_out_the_usual_port(name):
    headers = web_server.Headers({'Host': name, 'Origin': f'http://{name}'})
    assert page_server.is_own(web_server.Request('/', headers), 80)
    assert not page_server.is_own(web_server.Request('/', headers), 8080)


def test_the_page_is_as_wide_as_a_phone_and_whole(port):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    connection.request('GET', '/')
    answer = connection.getresponse()
    body = answer.read()
    assert body.count(b'width=device-width') == 1
    assert len(body) == int(answer.headers['Content-Length'])
    assert body.rstrip().endswith(b'</html>')


def test_those_without_panels_read_what_they_say(port):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    connection.request('GET', '/status')
    answer = connection.getresponse()
    assert answer.status == 200
    assert b'<pre style="font-size:18px">status</pre>' in answer.read()


@pytest.mark.parametrize('path', ['/', '/model', '/web_client.js', '/model?total_bytes'])
def test_no_other_page_may_read_an_answer(port, path):
    assert get(port, path).headers['Access-Control-Allow-Origin'] is None
    assert upgrade(port, '/ui').headers['Access-Control-Allow-Origin'] is None


def drop(port: int, megabytes: int) -> None:
    """Try to leave so much at a page's server, in all ways that there are."""
    with pytest.raises(InvalidStatus):
        connect(f'ws://127.0.0.1:{port}/drop?sid=puppet', max_size=None)
    for path in ('/ui', '/state'):
        with (
            contextlib.suppress(ConnectionClosed, OSError),
            connect(f'ws://127.0.0.1:{port}{path}?sid=x', max_size=None) as other,
        ):
            data = bytes(1_000_000)
            for _ in range(megabytes):
                other.send(data)


@pytest.mark.slow
def test_a_file_that_is_dropped_is_refused_and_not_kept(view, port):
    with PagePuppet(view.url) as page:
        time.sleep(0.5)
        # Buffers that the first megabytes need, on either side, are no file that is kept.
        drop(port, 4)
        before = resident()
        drop(port, 40)
        # Either way that one can go is more than twice as much; the page's own threads go on.
        assert resident() - before < 15_000_000
        wait_until(lambda: page.frames)


def test_a_client_that_does_not_finish_its_request_is_let_go(port, monkeypatch):
    monkeypatch.setattr(page_server, 'HEADER_TIMEOUT', 0.3)
    for start in (b'', b'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: '):
        with socket.create_connection(('127.0.0.1', port), timeout=PATIENCE) as client:
            client.sendall(start)
            with contextlib.suppress(ConnectionResetError):
                assert client.recv(1) == b''


@pytest.mark.slow
def test_nobody_takes_the_robot_from_a_driver_who_is_there(view, port):
    with PagePuppet(view.url) as page:
        time.sleep(0.5)
        with connect(f'ws://127.0.0.1:{port}/state?sid=foreign') as state:
            state.send('force_control')
            assert 'controller' not in roles(state, 1.5)
        page.draw()
        page.tap('I')
        wait_until(lambda: 'i' in view.pressed_keys())


async def leave_a_task_that_fails_with(error: Exception) -> None:
    """Have a task fail that nobody asks how it ended."""

    async def fail() -> None:
        raise error

    task = asyncio.create_task(fail())
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    del task
    gc.collect()


@pytest.mark.slow
def test_a_browser_that_goes_while_it_is_sent_something_is_not_reported(view, caplog):
    asyncio.run(leave_a_task_that_fails_with(ConnectionClosedOK(None, None)))
    assert caplog.text == ''
    asyncio.run(leave_a_task_that_fails_with(ValueError('a fault')))
    assert 'a fault' in caplog.text


def wait_for_grant(state: ClientConnection, seconds: float) -> bool:
    """Return whether a browser is told within some seconds that control is its."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        with contextlib.suppress(TimeoutError):
            if state.recv(timeout=0.1) == 'grant':
                return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize('way', ['given', 'rests'])
def test_control_that_is_asked_for_goes_when_it_is_given_or_the_driver_rests(
    view, port, monkeypatch, way
):
    monkeypatch.setattr(turns, 'GIVEN_AFTER', 0.3 if way == 'rests' else 1000.0)
    with PagePuppet(view.url, session='first') as page:
        page.keys = {code('I')}
        page.draw(10)
        with connect(f'ws://127.0.0.1:{port}/state?sid=second') as state:
            state.send('request_control')
            wait_until(lambda: view.input.turns.waiting == 1)
            # Hands that hold a key keep it.
            assert not wait_for_grant(state, 1.0)
            assert view.input.turns.waiting == 1
            page.keys = set()
            if way == 'given':
                view.input.turns.give()
            assert wait_for_grant(state, PATIENCE)
            pressed: list[str] = []
            wait_until(
                lambda: (
                    pressed.extend(view.pressed_keys())
                    or bool({'LOST', 'RELEASE+i'} & set(pressed[-1:]))
                )
            )
            with PagePuppet(view.url, session='second') as other:
                wait_until(lambda: view.input.turns.waiting == 0)
                other.draw()
                other.tap('J')
    wait_until(lambda: 'j' in view.pressed_keys())


@pytest.mark.slow
def test_who_asks_for_control_and_does_not_take_it_ends_one_turn_alone(view, port, monkeypatch):
    monkeypatch.setattr(turns, 'GIVEN_AFTER', 0.3)
    monkeypatch.setattr(web_server, '_GRANT_EXPIRY_SEC', 0.1)
    with connect(f'ws://127.0.0.1:{port}/state?sid=idle') as idle:
        with PagePuppet(view.url, session='first') as page:
            page.draw()
            idle.send('request_control')
            assert wait_for_grant(idle, PATIENCE)
        with PagePuppet(view.url, session='first') as page:
            assert not wait_for_grant(idle, 1.0)
            page.draw()


@pytest.mark.slow
def test_what_waits_behind_the_message_that_ends_control_makes_nobody_drive(view, port):
    with PagePuppet(view.url, session='first') as page:
        page.draw()
        with connect(f'ws://127.0.0.1:{port}/state?sid=second') as state:
            state.send('request_control')
            wait_until(lambda: view.input.turns.waiting)
            # It may be over before all are sent.
            with page._sending, contextlib.suppress(ConnectionClosed):
                view.input.turns.give()
                for _ in range(12):
                    page.socket.send(input_packet(set()))
            assert wait_for_grant(state, PATIENCE)
            with PagePuppet(view.url, session='second') as other:
                other.draw()
    wait_until(lambda: not view.input.is_watched)


@pytest.mark.slow
def test_who_waits_and_goes_away_waits_no_more(view, port):
    with PagePuppet(view.url) as page:
        with connect(f'ws://127.0.0.1:{port}/state?sid=second') as state:
            for word, waiting in (
                ('request_control', 1),
                ('leave_queue', 0),
                ('force_control', 1),
            ):
                state.send(word)
                wait_until(lambda waiting=waiting: view.input.turns.waiting == waiting)
                assert not wait_for_grant(state, 0.3)
                assert view.input.turns.waiting == waiting
        wait_until(lambda: view.input.turns.waiting == 0)
        wait_until(lambda: page.frames)


@pytest.mark.slow
@pytest.mark.parametrize('opening', [(), (VERSION_PACKET,)], ids=['mute', 'only_its_version'])
def test_who_opened_the_page_first_and_says_nothing_keeps_nobody_out(
    view, port, monkeypatch, opening
):
    monkeypatch.setattr(page_server, 'SILENT_CONTROLLER', 0.5)
    with connect(f'ws://127.0.0.1:{port}/ui?sid=mute', max_size=None) as mute:
        for packet in opening:
            mute.send(packet)
        time.sleep(1.0)
        with PagePuppet(view.url) as page:
            page.draw()
            page.tap('I')
            wait_until(lambda: 'i' in view.pressed_keys())


def stop(port: int) -> str:
    """Press the E-STOP as a page without control does; return the answer."""
    own = f'http://127.0.0.1:{port}'
    with connect(f'ws://127.0.0.1:{port}/e_stop', origin=own, ping_interval=None) as socket:
        try:
            return str(socket.recv(PATIENCE))
        except ConnectionClosedOK:
            return ''


@contextlib.contextmanager
def reading(view: WebView) -> Iterator[list[str]]:
    """Take the page's keys as a run does, in a thread; yield them."""
    wait_until(lambda: not view.input.is_watched)  # a page of another test is LOST as it leaves
    view.pressed_keys()
    keys, is_over = list[str](), threading.Event()

    def read() -> None:
        while not is_over.wait(0.01):
            keys.extend(view.pressed_keys())

    thread = threading.Thread(target=read)
    thread.start()
    try:
        yield keys
    finally:
        is_over.set()
        thread.join()


def test_who_watches_stops_the_robot_and_is_told_so_when_the_run_has_heard_of_it(
    view, port, monkeypatch
):
    with reading(view) as keys:
        assert stop(port) == 'STOPPED'
        wait_until(lambda: keys)
    assert keys == ['ESC']
    monkeypatch.setattr(page_server, 'E_STOP_TIMEOUT', 0.2)
    assert [stop(port) for _ in range(3)] == ['', '', '']
    assert view.pressed_keys() == ['ESC']
    assert view.pressed_keys() == []


def test_where_nothing_can_be_stopped_no_page_has_an_e_stop(view, port, monkeypatch):
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    for can_stop in (True, False):
        monkeypatch.setattr(view.input, 'can_stop', can_stop)
        connection.request('GET', '/')
        assert (b'/e_stop' in connection.getresponse().read()) is can_stop
        connection.close()
    assert upgrade(port, '/e_stop').status == 404


@pytest.mark.slow
def test_who_watches_and_stops_drives_nothing_and_keeps_nobody_from_their_turn(view, port):
    with (
        reading(view) as keys,
        PagePuppet(view.url) as page,
        connect(f'ws://127.0.0.1:{port}/state?sid=waits') as waits,
    ):
        page.keys = {code('I')}
        page.draw()
        waits.send('request_control')
        wait_until(lambda: view.input.turns.waiting)
        assert [stop(port) for _ in range(5)] == 5 * ['STOPPED']
        wait_until(lambda: keys.count('ESC') == 5)
        page.is_silent = True
        wait_until(lambda: 'LOST' in keys)
        assert stop(port) == 'STOPPED'
        page.is_silent = False
        page.keys = set()
        page.draw()
        page.tap('J')
        assert view.input.turns.waiting == 1
        wait_until(lambda: 'j' in keys)
        assert keys.count('ESC') == 6
    wait_until(lambda: not view.input.is_watched)


@pytest.mark.slow
def test_what_is_wrong_with_a_press_of_the_e_stop_breaks_nothing(view, port, caplog):
    def press() -> socket.socket:
        client = socket.create_connection(('127.0.0.1', port), timeout=PATIENCE)
        words = {'Host': f'127.0.0.1:{port}', 'Connection': 'Upgrade', 'Upgrade': 'websocket'}
        words |= {'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ=='}
        lines = [f'{name}: {value}' for name, value in words.items()]
        client.sendall('\r\n'.join(('GET /e_stop HTTP/1.1', *lines, '', '')).encode())
        return client

    wait_until(lambda: not view.input.is_watched)
    view.pressed_keys()
    assert get(port, '/e_stop').status == 426
    assert view.pressed_keys() == []
    with reading(view) as keys:
        for _ in range(10):
            with contextlib.ExitStack() as stack:
                clients = [stack.enter_context(press()) for _ in range(100)]
                for client in clients[::2]:  # the others go without a word
                    with contextlib.suppress(ConnectionError):
                        client.sendall(b'\xff' * 10_000)
        wait_until(lambda: 'ESC' in keys)
        assert stop(port) == 'STOPPED'
        assert set(keys) == {'ESC'}
    assert caplog.text == ''


@pytest.mark.slow
def test_a_page_that_has_fallen_silent_keeps_nobody_out(view, port):
    with PagePuppet(view.url, session='orphan') as orphan:
        time.sleep(0.5)
        orphan.is_silent = True
        time.sleep(1.0)
        with connect(f'ws://127.0.0.1:{port}/state?sid=puppet') as state:
            state.send('force_control')
            time.sleep(1.0)
            with PagePuppet(view.url) as page:
                page.draw()
                page.tap('I')
                wait_until(lambda: 'controller' in roles(state, 0.1))
    wait_until(lambda: 'i' in view.pressed_keys())


@pytest.mark.slow
@pytest.mark.parametrize('rate', [2.0, 4.0, 20.0])
def test_a_browser_is_sent_no_more_panels_than_it_draws(view, rate):
    with PagePuppet(view.url, rate) as page:
        wait_until(lambda: page.frames)
        frames, pictures = page.frames, page.pictures
        wait_until(lambda: page.pictures >= pictures + 3 * rate)
        assert 0 < page.frames - frames <= page.pictures - pictures + 2


@pytest.mark.slow
def test_what_the_panels_of_a_slow_page_say_is_never_older_than_two_pictures(view):
    with PagePuppet(view.url, rate=2.0) as page:
        wait_until(lambda: len(page.shown) >= 12)
        shown = np.array(page.shown[2:])  # after the connection was made
    # A frame is built when a picture was heard. Each picture shows one that was built after the
    # picture before, or, where a busy machine was late, after the one before that; none queues.
    assert (shown[2:] > shown[:-2]).all(), shown
    behind = np.arange(len(shown)) - (shown - shown[0])
    assert np.ptp(behind) <= 1, shown


@pytest.mark.slow
def test_a_silent_browser_is_sent_no_panels(view):
    with PagePuppet(view.url) as page:
        page.draw()
        page.is_silent = True
        frames, deadline = -1, time.monotonic() + PATIENCE
        while frames != page.frames:  # what is on its way
            assert time.monotonic() < deadline, 'panels go on coming'
            frames = page.frames
            time.sleep(2.0)


@pytest.mark.slow
def test_input_that_is_none_of_studios_drives_nothing_and_is_told(view, port, caplog):
    with PagePuppet(view.url) as page:
        time.sleep(0.3)
        page.socket.send(b'\x00' * 64)
        page.hold('I', seconds=0.3)
        assert 'i' not in view.pressed_keys()
    wait_until(lambda: 'the page cannot drive' in caplog.text)


def test_the_page_is_worked_on_as_often_as_somebody_looks(view, port):
    wait_until(lambda: not view.input.is_watched)
    unseen = view.period
    with connect(f'ws://127.0.0.1:{port}/state?sid=looks'):
        # The server may say something before it hears anything.
        wait_until(lambda: view.input.is_watched)
        seen = view.period
        view.sync(is_hurried=True)
        assert seen < view.period < unseen
        view.sync()
        assert view.period == seen
    # Who says so and is gone at once is nobody who looks, either.
    for _ in range(20):
        with connect(f'ws://127.0.0.1:{port}/state?sid=goes') as state:
            state.send(page_server.LEAVE)
    wait_until(lambda: view.period == unseen)


def test_what_the_page_says_to_studio_does_not_gather(view):
    events = view._handle._sim_endpoint._v2s_events
    for _ in range(3):
        events.put(messages.SingleStepEvent())
        view.sync()
        assert events.get() == []


@pytest.mark.slow
def test_a_panel_that_fails_costs_nothing_but_itself(view, caplog, monkeypatch):
    monkeypatch.setattr(STATUS, 'fails', True)
    with PagePuppet(view.url) as page:
        time.sleep(1.0)
        frames = page.frames
        page.tap('I')
        view.sync()
        wait_until(lambda: page.frames > frames)
        wait_until(lambda: 'i' in view.pressed_keys())
    assert caplog.text.count('panel status failed') == 1
