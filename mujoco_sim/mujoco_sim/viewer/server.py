# SPDX-License-Identifier: Apache-2.0
"""Studio's web server, restricted to this page on this machine."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator
import contextlib
import functools
import html
import logging
import struct
from typing import Any, cast

from mujoco.studio.web.web_server import (
    ConnectionClosed,
    Headers,
    Request,
    Response,
    serve,
    ServerConnection,
)
from wasd_core.network import LOOPBACK

from mujoco_sim.viewer.clicks import Mouse
from mujoco_sim.viewer.head import E_STOP, HEAD
from mujoco_sim.viewer.input import PageInput
from mujoco_sim.viewer.strokes import Stroke
from mujoco_sim.viewer.studio import session_of, SILENT_CONTROLLER

NAMES = (LOOPBACK, 'localhost')
# Browsers leave this port out of a host's name.
UNNAMED_PORT = 80
# A client has so long for its request [s] ...
HEADER_TIMEOUT = 5.0
# ... and so long to take the answer, which is megabytes for some: a page over a slow tunnel [s].
ANSWER_TIMEOUT = 300.0
# A browser that answers no ping for so long is let go [s].
PING_PERIOD, PING_TIMEOUT, CLOSE_TIMEOUT = 5.0, 10.0, 1.0
# What a page says that asks for control, and the code that ends its control.
REQUEST, FORCE, LEAVE = 'request_control', 'force_control', 'leave_queue'
CONTROL_TAKEN = 4001
# A page without control presses the E-STOP by a WebSocket there. The answer comes when the run has
# taken that, for which it has so long; that is looked at so often [s].
E_STOP_PATH, STOPPED = '/e_stop', 'STOPPED'
E_STOP_TIMEOUT, E_STOP_PERIOD = 2.0, 0.02
# No message of a page is longer: files to drop are refused, what is left is input and a clipboard.
LONGEST_MESSAGE = 1 << 20

_FORBIDDEN = b'This page is for the browser of this machine: see docs/keyboard.md.\n'
# What a spectator sees of the panels, which only the driver has.
TEXT_PATH = '/status'
_TEXT_PAGE = b"""<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="refresh" content="1"><title>wasd</title></head>
<body style="background:#17191f;color:#e0e5ec"><pre style="font-size:18px">%s</pre></body></html>
"""
_LOG = logging.getLogger(__name__)

Handler = Callable[[ServerConnection], Awaitable[None]]
ProcessRequest = Callable[[ServerConnection, Request], Response | None]
ProcessResponse = Callable[[ServerConnection, Request, Response], Response | None]

# NetImgui's header: u32 size, u8 type, 3 bytes of nothing.
_HEADER = struct.Struct('<IB3x')
INPUT_TYPE = 2
# NetImgui 18's input: at 12 two i16, where the pointer is [pixels]; at 24 text in UTF-16, and at
# 536 a u16, how many of its u16; at 552 a u64, a bit for each button of the mouse; at 560 three of
# them, a bit for each key from ImGui's number 512 on.
INPUT_SIZE = 616
_PLACE = struct.Struct('<2h')
_PLACE_AT = 12
_TEXT_AT = 24
_LENGTH = struct.Struct('<H')
_LENGTH_AT = 536
_BUTTONS = struct.Struct('<Q')
_BUTTONS_AT = 552
_KEYS = struct.Struct('<3Q')
_KEYS_AT = 560
FIRST_KEY = 512
# No packet of a browser is longer: the text of a clipboard.
LONGEST = 1 << 20


def is_own(request: Request, port: int) -> bool:
    """
    Whether a request is made by this page or by a program of this machine.

    A page of somebody else names its origin; one whose name was made to lead here names its host.
    """
    hosts = request.headers.get_all('Host')
    own = {f'{name}:{port}' for name in NAMES} | set(NAMES if port == UNNAMED_PORT else ())
    if len(hosts) != 1 or hosts[0].lower() not in own:
        return False
    origins = request.headers.get_all('Origin')
    return not origins or [text.lower() for text in origins] == [f'http://{hosts[0].lower()}']


class PageConnection(ServerConnection):  # type: ignore[misc]  # MuJoCo has no types
    """
    One connection of a browser: it is closed when no request comes.

    The page's input is heard where Studio reads it: that is the controlling browser's only.
    """

    def __init__(self, page_input: PageInput, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._input = page_input
        self._packets: InputPackets | None = InputPackets()
        self._is_lost = self._is_heard = False
        self._made = 0.0
        self.over = asyncio.Event()  # set when Studio has done with it

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for a request, but not for ever."""
        super().connection_made(transport)
        self._made = self.loop.time()
        self.loop.call_later(HEADER_TIMEOUT, self._give_up)

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell that nothing more will come."""
        self._is_lost = True
        self._input.lose(self)
        if self.path == '/state':
            self._input.turns.leave(self._session)
        super().connection_lost(exc)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message; hear what it says of the page."""
        if self.path == '/state' and not self._is_lost:
            self._input.watch(self)
        message = await super().recv(decode)
        turns = self._input.turns
        if self.path == '/ui' and isinstance(message, bytes):
            turns.leave(self._session)
            message = self._hear(message)
            if turns.take_end():
                # Studio then grants control to the one who has waited longest.
                await self.close(CONTROL_TAKEN, 'control was asked for')
        elif self.path == '/state':
            if message == FORCE and self._input.is_present:
                # Nobody takes a robot from a driver who is there: they wait for their turn.
                message = REQUEST
            if message == REQUEST:
                turns.ask(self._session)
            elif message == LEAVE:
                turns.leave(self._session)
        return message

    async def stop_robots(self) -> None:
        """Press the E-STOP, and answer."""
        until, number = self.loop.time() + E_STOP_TIMEOUT, self._input.press_e_stop()
        while self._input.stops_taken < number:
            if self.loop.time() > until:
                return
            await asyncio.sleep(E_STOP_PERIOD)
        with contextlib.suppress(ConnectionClosed):
            await self.send(STOPPED)

    @property
    def is_mute(self) -> bool:
        """Whether it was opened a while ago, and no key or pointer was ever told by it."""
        return not self._is_heard and self.loop.time() - self._made > SILENT_CONTROLLER

    @property
    def path(self) -> str:
        """What of the server it has asked for."""
        return self.request.path.partition('?')[0] if self.request else ''

    @property
    def _session(self) -> str:
        return session_of(self)

    def _give_up(self) -> None:
        if self.request is None:
            self.transport.abort()

    def _hear(self, data: bytes) -> bytes:
        """Hear what a browser sends; return the part for Studio."""
        # What has waited until its connection ended is from nobody: heard, it would be a page that
        # is there for ever, and keep all others out.
        if self._packets is None or self._is_lost:
            return data
        shown = []
        try:
            for packet, pressed in self._packets.feed(data):
                if pressed is not None:
                    self._is_heard = True
                    packet = with_mouse(packet, self._input.hear(self, *pressed))
                    stroke = Stroke(pressed[0], text_of(packet))
                    packet = with_stroke(packet, self._input.type(stroke))
                shown.append(packet)
        except UnknownPacket as error:
            rest, self._packets = self._packets.rest, None
            self._input.lose(self)
            _LOG.error('the page cannot drive: its browser sent %s', error)
            shown.append(rest)
        return b''.join(shown)


class _Place:
    """The driver's place on the page: a silent browser that holds it gives way."""

    def __init__(self, handler: Handler) -> None:
        self._handler = handler
        self._drivers: set[PageConnection] = set()

    async def serve(self, connection: PageConnection) -> None:
        """Hand a connection to Studio, but not an E-STOP's."""
        if connection.path == E_STOP_PATH:
            await connection.stop_robots()
            return
        if connection.path == '/ui':
            self._drivers.add(connection)
        try:
            await self._handler(connection)
        finally:
            self._drivers.discard(connection)
            connection.over.set()

    async def make_room(self) -> None:
        """Let mute drivers go, for one who comes and may."""
        for mute in [driver for driver in self._drivers if driver.is_mute]:
            await mute.close(CONTROL_TAKEN, 'it says nothing')
            await mute.over.wait()


def _close_to_others(
    process_response: ProcessResponse,
    connection: ServerConnection,
    request: Request,
    response: Response,
) -> Response | None:
    """Forbid pages of other origins to read an answer."""
    if response.status_code == 101:
        process_response(connection, request, response)
    for name in ('Access-Control-Allow-Origin', 'Cross-Origin-Resource-Policy'):
        if name in response.headers:
            del response.headers[name]
    response.headers['Cross-Origin-Resource-Policy'] = 'same-origin'
    return None


def serve_page(
    page_input: PageInput,
    text: Callable[[], str],
    handler: Handler,
    *,
    process_request: ProcessRequest,
    process_response: ProcessResponse,
    **options: Any,
) -> Any:
    """
    Serve as Studio asks for, for this machine only, and tell the page's input.

    `text` returns what a page without panels shows of the run; the server's thread calls it.
    """
    port: int = options['sock'].getsockname()[1]
    place = _Place(handler)

    def check(connection: ServerConnection, request: Request) -> Response | None:
        path = request.path.partition('?')[0]
        if not is_own(request, port) or path == '/drop':
            return _response(403, 'Forbidden', 'text/plain', _FORBIDDEN)
        if path == TEXT_PATH:
            words = html.escape(text()).encode()
            return _response(200, 'OK', 'text/html; charset=utf-8', _TEXT_PAGE % words)
        if path == E_STOP_PATH and page_input.can_stop:
            return None
        response = process_request(connection, request)
        if response is not None and path in ('/', '/index.html') and response.status_code == 200:
            return _with_head(response, HEAD + E_STOP * page_input.can_stop)
        return response

    async def admit(connection: ServerConnection, request: Request) -> Response | None:
        response = check(connection, request)
        if response is None and request.path.partition('?')[0] == '/ui':
            await place.make_room()
        return response

    return serve(
        place.serve,
        process_request=admit,
        process_response=functools.partial(_close_to_others, process_response),
        create_connection=cast(Any, functools.partial(PageConnection, page_input)),
        **options
        | {
            'open_timeout': ANSWER_TIMEOUT,
            'ping_interval': PING_PERIOD,
            'ping_timeout': PING_TIMEOUT,
            'close_timeout': CLOSE_TIMEOUT,
            'max_size': LONGEST_MESSAGE,
        },
    )


def _response(status: int, reason: str, kind: str, body: bytes) -> Response:
    headers = Headers({'Content-Type': kind, 'Content-Length': str(len(body))})
    headers['Cache-Control'] = 'no-store'
    return Response(status, reason, headers, body)


def _with_head(response: Response, head: bytes) -> Response:
    """Return Studio's page with what is ours in its head."""
    body = response.body.replace(b'<head>', head, 1)
    if 'Content-Length' in response.headers:
        del response.headers['Content-Length']
        response.headers['Content-Length'] = str(len(body))
    return Response(response.status_code, response.reason_phrase, response.headers, body)


class UnknownPacket(ValueError):
    """A browser sends what Studio's own page would not."""


class InputPackets:
    """Takes what one browser sends, however it is cut; `rest` is the begin of the next packet."""

    def __init__(self) -> None:
        self.rest = b''

    def feed(self, data: bytes) -> Iterator[tuple[bytes, tuple[frozenset[int], Mouse] | None]]:
        """
        Yield each packet that is whole; of one of input the keys that are down, and the mouse.

        Raises:
            UnknownPacket: what came is no packet, or an input packet of another layout.
        """
        self.rest += data
        while len(self.rest) >= _HEADER.size:
            size, kind = _HEADER.unpack_from(self.rest)
            if not _HEADER.size <= size <= LONGEST:
                raise UnknownPacket(f'a packet of {size} bytes')
            if len(self.rest) < size:
                return
            packet = self.rest[:size]
            pressed = (keys_down(packet), mouse_of(packet)) if kind == INPUT_TYPE else None
            self.rest = self.rest[size:]
            yield packet, pressed


def mouse_of(packet: bytes) -> Mouse:
    """Return the mouse of an input packet."""
    (buttons,) = _BUTTONS.unpack_from(packet, _BUTTONS_AT)
    return Mouse(buttons, _PLACE.unpack_from(packet, _PLACE_AT))


def with_mouse(packet: bytes, mouse: Mouse) -> bytes:
    """Return an input packet with another mouse."""
    changed = bytearray(packet)
    _BUTTONS.pack_into(changed, _BUTTONS_AT, mouse.buttons)
    _PLACE.pack_into(changed, _PLACE_AT, *mouse.place)
    return bytes(changed)


def text_of(packet: bytes) -> str:
    """Return the text that was typed in an input packet."""
    (length,) = _LENGTH.unpack_from(packet, _LENGTH_AT)
    text = packet[_TEXT_AT : min(_TEXT_AT + 2 * length, _LENGTH_AT)]
    return text.decode('utf-16-le', 'surrogatepass')


def with_stroke(packet: bytes, stroke: Stroke) -> bytes:
    """Return an input packet with other keys and another text."""
    changed = bytearray(packet)
    text = stroke.text.encode('utf-16-le', 'surrogatepass')
    changed[_TEXT_AT : _TEXT_AT + len(text)] = text
    _LENGTH.pack_into(changed, _LENGTH_AT, len(text) // 2)
    bits = sum(1 << key - FIRST_KEY for key in stroke.keys)
    changed[_KEYS_AT : _KEYS_AT + _KEYS.size] = bits.to_bytes(_KEYS.size, 'little')
    return bytes(changed)


def keys_down(packet: bytes) -> frozenset[int]:
    """
    Return ImGui's numbers of the keys that are down in an input packet.

    Raises:
        UnknownPacket: it has another layout than that of the NetImgui that this reads.
    """
    if len(packet) != INPUT_SIZE:
        raise UnknownPacket(f'an input packet of {len(packet)} bytes, wanted {INPUT_SIZE}')
    down = []
    for word, bits in enumerate(_KEYS.unpack_from(packet, _KEYS_AT)):
        while bits:
            lowest = bits & -bits
            down.append(FIRST_KEY + 64 * word + lowest.bit_length() - 1)
            bits ^= lowest
    return frozenset(down)
