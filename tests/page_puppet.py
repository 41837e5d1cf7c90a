# SPDX-License-Identifier: Apache-2.0
"""
A browser of a page without a browser: sends what Studio's own page would, and counts answers.

As a program, `python page_puppet.py URL PICTURES_PER_SECOND KEY...`, it holds keys until it dies.
"""

import contextlib
import random
import struct
import sys
import threading
import time
from typing import Any, Self

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.input import PAGE_KEYS
from mujoco_sim.viewer.server import CONTROL_TAKEN
from terminals import PATIENCE
from wasd_cockpit.widgets import Rect
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

# The versions in the first packet, of NetImgui 18: the layouts below are this one's.
VERSIONS_AT = 72
VERSIONS = struct.pack('<16s16sIIII', b'1.92.9b', b'1.13.0', 18, 0x4B5B, 0x2C24, 2)
VERSION_PACKET = struct.pack('<IB3x', 120, 0) + b'puppet'.ljust(64, b'\0') + VERSIONS
INPUT_TYPE, DRAW_TYPE = 2, 3
SIZE = (900, 600)
# Where the scene is, and no panel [pixels].
SCENE = (600, 400)


def code(key: str) -> int:
    """Return ImGui's number of a key by its name in ImGui, 'W' or 'LeftShift'."""
    return int(getattr(imgui.Key, key).value)


def middle_of(rect: Rect) -> tuple[int, int]:
    """Return the point in the middle of a rectangle on the page [pixels]."""
    return round(0.5 * (rect.left + rect.right)), round(0.5 * (rect.top + rect.bottom))


def input_packet(
    keys: set[int],
    mouse: tuple[int, int] = SCENE,
    buttons: int = 0,
    size: tuple[int, int] = SIZE,
    text: str = '',
) -> bytes:
    """Return what a page of a size [pixels] sends with each picture; `text` is typed in it."""
    packet = bytearray(616)
    struct.pack_into('<IB', packet, 0, len(packet), INPUT_TYPE)
    struct.pack_into('<HHhh', packet, 8, *size, *mouse)
    for index, character in enumerate(text):
        struct.pack_into('<H', packet, 24 + 2 * index, ord(character))
    struct.pack_into('<HBBfff', packet, 536, len(text), 1, 0, 1.0, 60.0, 0.0)
    words = [0, 0, 0]
    for key in keys:
        words[(key - 512) // 64] |= 1 << (key - 512) % 64
    struct.pack_into('<Q3Q', packet, 552, buttons, *words)
    return bytes(packet)


class CutOff(AssertionError):
    """The page's connection has ended."""


class PagePuppet:
    """
    Context of a controlling page that draws `rate` pictures a second.

    `keys` are down (ImGui's numbers), `mouse` and `buttons` are where the pointer is; `frames` are
    the frames of panels that came, `shown` has their number at each picture. It tries again for
    `patience` [s] while another page has control: a busy server sees late that one has gone.

    Raises:
        AssertionError: the server speaks another version than this was made for.
        ConnectionClosed: another page keeps control.
    """

    def __init__(
        self,
        url: str,
        rate: float = 50.0,
        session: str = 'puppet',
        size: tuple[int, int] = SIZE,
        patience: float = PATIENCE,
    ) -> None:
        self.size, self._patience = size, patience
        self._text = ''
        self.received = 0  # bytes of panels
        self.keys: set[int] = set()
        self.mouse, self.buttons = SCENE, 0
        self.frames = self.pictures = 0
        self.shown: list[int] = []
        self.is_silent = False
        self.rate = rate
        self._url = f'{url.replace("http", "ws", 1)}ui?sid={session}'
        self._origin = url.rstrip('/')
        self._stop = threading.Event()
        self._sending = threading.Lock()
        self._stack = contextlib.ExitStack()
        self._unread = b''

    def __enter__(self) -> Self:
        """Connect, and draw from now on."""
        until = time.monotonic() + self._patience
        while not self._has_control(until):
            time.sleep(0.05)
        self._threads = [threading.Thread(target=run) for run in (self._draw, self._count)]
        for thread in self._threads:
            thread.start()
        return self

    def _has_control(self, until: float) -> bool:
        """Connect; return False if another page has control before `until`, else raise."""
        opened = connect(
            self._url, origin=self._origin, compression=None, max_size=None, ping_interval=None
        )
        with contextlib.ExitStack() as stack:
            self.socket: ClientConnection = stack.enter_context(opened)
            try:
                self.socket.send(VERSION_PACKET)
                answer = bytes(self._read(120))
            except ConnectionClosed as closed:
                is_taken = closed.rcvd is not None and closed.rcvd.code == CONTROL_TAKEN
                if not is_taken or time.monotonic() > until:
                    raise
                return False
            spoken = answer[VERSIONS_AT:]
            assert spoken == VERSIONS, f'NetImgui speaks {spoken!r}, this puppet {VERSIONS!r}'
            self._stack.push(stack.pop_all())
        return True

    def __exit__(self, *_: Any) -> None:
        """Close the page."""
        self._stop.set()
        self._stack.close()
        for thread in self._threads:
            thread.join()

    def hold(self, *keys: str, seconds: float) -> None:
        """Hold keys by their names in ImGui for some seconds, and let them go."""
        self.keys = {code(key) for key in keys}
        time.sleep(seconds)
        self.keys = set()

    def tap(self, *keys: str, seconds: float = 0.15) -> None:
        """Press keys together, and wait as a finger does; like ImGui, have each seen once."""
        for down, least in (({code(key) for key in keys}, seconds), (set(), 0.15)):
            drawn, until = self.pictures, time.monotonic() + least
            self.keys = down
            while self.pictures < drawn + 2 or time.monotonic() < until:
                time.sleep(0.005)

    def click(self, x: int, y: int) -> None:
        """Click at a place of the page [pixels]."""
        self.mouse = (x, y)
        for buttons in (0, 1, 0):
            self.buttons = buttons
            time.sleep(max(0.15, 2.5 / self.rate))
        time.sleep(0.3)

    def draw(self, pictures: int = 3) -> None:
        """
        Wait until so many pictures more were drawn, and panels know of them.

        Raises:
            CutOff: the connection has ended.
        """
        until, frames = self.pictures + pictures, self.frames + 2
        while self.pictures < until or self.frames < frames:
            if not all(thread.is_alive() for thread in self._threads):
                raise CutOff('the page was cut off')
            time.sleep(0.002)

    def press_at(self, place: tuple[int, int]) -> None:
        """Put the pointer somewhere and the mouse's button down, and leave it so."""
        self.mouse = place
        self.draw()
        self.buttons = 1
        self.draw()

    def drag_to(self, place: tuple[int, int], steps: int = 4) -> None:
        """Move the pointer to a place, as a hand does."""
        (x, y), (to_x, to_y) = self.mouse, place
        for step in range(1, steps + 1):
            share = step / steps
            self.mouse = round(x + share * (to_x - x)), round(y + share * (to_y - y))
            self.draw(1)

    def tap_at(self, place: tuple[int, int], away: tuple[int, int] | None = None) -> None:
        """
        Put the pointer somewhere, and the mouse's button down and up at once.

        With a place `away` it goes up there, and comes from there at once, too.
        """
        self.mouse = away or place
        self.draw()
        with self._sending:
            for buttons, mouse in ((1, place), (0, self.mouse)):
                self.socket.send(input_packet(self.keys, mouse, buttons, self.size))

    def let_go(self) -> None:
        """Let the mouse's button up."""
        self.buttons = 0
        self.draw()

    def scribble(self, count: int, rect: Any, chance: random.Random, presses: float = 0.1) -> None:
        """
        Do so many things at random in a rectangle: move, press, drag, type, hold keys.

        Of a hundred, 10 (`presses`, a share) are a button up or down, 3 keys held or let go, 2 a
        character, and the rest moves: a frame of panels takes any number, but one press, of which
        Studio makes sixty a second.
        """
        keys = sorted(PAGE_KEYS)
        for _ in range(count):
            x, y = chance.uniform(rect.left, rect.right), chance.uniform(rect.top, rect.bottom)
            self.mouse = round(x), round(y)
            what, text = chance.random(), ''
            if what < presses:
                self.buttons = chance.choice((0, 0, 1, 1, 2))
            elif what < 1.3 * presses:
                self.keys = set(chance.sample(keys, chance.choice((0, 1, 2))))
            elif what < 1.5 * presses:
                text = chance.choice('x7')
            with self._sending:
                self.socket.send(
                    input_packet(self.keys, self.mouse, self.buttons, self.size, text)
                )
            time.sleep(0.0003)

    def type(self, text: str, at_once: bool = False) -> None:
        """Type a text, a character in each picture or all in one."""
        for part in [text] if at_once else text:
            self._text = part
            while self._text:
                time.sleep(0.002)
            self.draw()

    def strike(self, *strokes: tuple[set[int], str]) -> None:
        """Tell of keys that are down, and of text, at once; the last keys stay down."""
        with self._sending:
            for keys, text in strokes:
                self.keys = keys
                self.socket.send(input_packet(keys, self.mouse, self.buttons, self.size, text))

    def _rest(self) -> bool:
        """Wait until the next picture is to be drawn; return whether none is any more."""
        return self._stop.wait(1.0 / self.rate)

    def _draw(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while not self._rest():
                if not self.is_silent:
                    self.shown.append(self.frames)
                    text, self._text = self._text, ''
                    with self._sending:
                        self.socket.send(
                            input_packet(self.keys, self.mouse, self.buttons, self.size, text)
                        )
                    self.pictures += 1

    def _count(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                size, kind = struct.unpack('<IB', self._read(8)[:5])
                self._read(size - 8)
                self.received += size
                self.frames += kind == DRAW_TYPE

    def _read(self, size: int) -> bytes:
        while len(self._unread) < size:
            self._unread += self.socket.recv()
        data, self._unread = self._unread[:size], self._unread[size:]
        return data


def main() -> None:
    """Hold keys on a page until the end."""
    with PagePuppet(sys.argv[1], float(sys.argv[2])) as page:
        page.draw()
        page.keys = {code(key) for key in sys.argv[3:]}
        print('holding', flush=True)
        threading.Event().wait()


if __name__ == '__main__':
    main()
