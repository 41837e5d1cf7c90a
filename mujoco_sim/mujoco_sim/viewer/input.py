# SPDX-License-Identifier: Apache-2.0
"""What the controlling browser says: its keys, and whether it is known to be alive."""

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
import threading
import time

from mujoco.studio.dear_imgui import dear_imgui as imgui
from wasd_core.timing import HELD, HELD_PERIOD, LOST, RELEASE, REPEAT_RATE, Watchdog, with_event

from mujoco_sim.viewer.clicks import Box, Clicks, IDLE, Mouse
from mujoco_sim.viewer.strokes import Stroke, Strokes
from mujoco_sim.viewer.turns import Turns

# What is held down on a page counts for so long after it was heard [s]: with every picture.
SILENCE = 0.5
# A page that was not heard for so long is lost, and what it has set moving is stopped [s]: within
# a second, but not between two pictures of a slow one.
LOSS = 0.85
# A key that went down in a longer silence was not pressed now [s]: it may have waited in a queue.
GONE = 2.0
# A page that draws fewer pictures a second than this is slow.
SLOW = 10
# How long pictures are counted [s], and how many at most.
_WINDOW = 1.0
_MOST_PICTURES = 500

# A key that is held repeats after so long [s].
REPEAT_DELAY = 0.45
# What one report of a key that is down proves at most [s]: one that comes late, because either
# side was busy, must not make repeats of a tap.
LONGEST_PROOF = 0.1
# More events than these are of no use to anybody: nobody is reading.
MOST_EVENTS = 1000

# Characters of the page's keys on a US keyboard, without and with Shift.
_CHARACTERS = {
    'Space': '  ',
    'Apostrophe': '\'"',
    'Comma': ',<',
    'Minus': '-_',
    'Period': '.>',
    'Slash': '/?',
    'Semicolon': ';:',
    'Equal': '=+',
    'LeftBracket': '[{',
    'Backslash': '\\|',
    'RightBracket': ']}',
    'GraveAccent': '`~',
    'KeypadDecimal': '..',
    'KeypadDivide': '//',
    'KeypadMultiply': '**',
    'KeypadSubtract': '--',
    'KeypadAdd': '++',
    'KeypadEqual': '==',
}
_CHARACTERS |= {f'N{digit}': f'{digit}{shifted}' for digit, shifted in enumerate(')!@#$%^&*(')}
_CHARACTERS |= {f'Keypad{digit}': 2 * str(digit) for digit in range(10)}
_CHARACTERS |= {letter: letter.lower() + letter for letter in 'ABCDEFGHIJKLMNOPQRSTUVWXYZ'}
_NAMES = {
    'UpArrow': 'UP',
    'DownArrow': 'DOWN',
    'LeftArrow': 'LEFT',
    'RightArrow': 'RIGHT',
    'Home': 'HOME',
    'End': 'END',
    'PageUp': 'PGUP',
    'PageDown': 'PGDN',
    'Insert': 'INSERT',
    'Delete': 'DELETE',
    'Escape': 'ESC',
    'Enter': 'ENTER',
    'KeypadEnter': 'ENTER',
    'Tab': 'TAB',
    'Backspace': 'BACKSPACE',
}
_NAMES |= {f'F{number}': f'F{number}' for number in range(1, 13)}


class PageInput:
    """
    The one gate for everything that a page commands: keys, sticks, pushes.

    A press is proved by the packet that tells of it, whatever the rate of pictures; what lasts
    counts only while `is_alive`.

    The server's thread calls `watch`, `hear`, `lose` and `press_e_stop`, the viewer's `rest`,
    `wait_for_picture` and `set_typing`, the simulation's `take_keys`. What the pointer holds down
    asks `silence`.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock of wall time [s]."""
        self._clock = clock
        self._lock = threading.Condition()
        self._life = Watchdog(SILENCE)
        self._presence = Watchdog(LOSS)
        self._keys = PageKeys()
        self._stepped = clock()
        self._source: object | None = None
        self._watchers: set[object] = set()
        self._is_resting = False
        self._is_typing = False
        self._pictures: deque[float] = deque(maxlen=_MOST_PICTURES)
        self._undrawn = False
        self._clicks = Clicks()
        self._mouse = IDLE  # as it was told last
        self._strokes = Strokes(MARK, ACTS)
        self.turns = Turns(clock)
        self._silence = 0.0  # the longest that a button is down since before [s]
        self.has_clicked = False  # until a frame of panels was begun for it
        self.are_several = False  # pointers down, or were since none was: no click is of one alone
        self.e_stop: Box | None = None  # where the panels have theirs
        self.can_stop = False  # whether there is a robot that pages without control may stop
        self._stops = 0
        self.stops_taken = 0  # of the e-stops of such pages

    @property
    def is_alive(self) -> bool:
        """Whether the controlling browser was heard within SILENCE."""
        with self._lock:
            self._step()
            return self._life.is_alive

    @property
    def silence(self) -> float:
        """
        How long the browser has been silent, now or while a button was down [s], or before.

        What the pointer holds down, a stick or a push, counts within SILENCE, a click within LOSS.
        """
        with self._lock:
            self._step()
            return max(self._silence, self._life.age)

    @property
    def is_present(self) -> bool:
        """Whether the controlling browser was heard within LOSS: it may only be slow."""
        with self._lock:
            self._step()
            return self._presence.is_alive

    @property
    def has_source(self) -> bool:
        """Whether a browser that has been heard is still connected, silent or not."""
        return self._source is not None

    @property
    def is_watched(self) -> bool:
        """Whether any browser is there, if only to watch the scene."""
        return self.has_source or bool(self._watchers)

    @property
    def is_alone(self) -> bool:
        """Whether a browser that has been heard is the only one that is there."""
        return self.has_source and len(self._watchers) <= 1

    @property
    def rate(self) -> int | None:
        """How many pictures the browser has drawn in the last second; None for a new one."""
        with self._lock:
            pictures, begin = self._pictures, self._clock() - _WINDOW
            # One from before says that there was a browser all the time.
            while len(pictures) > 1 and pictures[1] < begin:
                pictures.popleft()
            return len(pictures) - 1 if pictures and pictures[0] <= begin else None

    @property
    def is_slow(self) -> bool:
        """Whether the browser draws fewer than SLOW pictures a second."""
        rate = self.rate
        return rate is not None and rate < SLOW

    @property
    def is_click_unseen(self) -> bool:
        """Whether a button has gone down or up since the last frame of panels that saw any."""
        return self.has_source and not self._clicks.is_seen

    @property
    def can_hold(self) -> bool:
        """Whether the browser draws often enough to hold something: twice in a SILENCE."""
        rate = self.rate
        return rate is None or rate * SILENCE >= 2.0

    def see(self, buttons: int, is_marked: bool = False) -> None:
        """Take what a frame of panels has seen down: buttons, a bit for each, and MARK."""
        self._clicks.see(buttons)
        self._strokes.see(is_marked)

    def type(self, told: Stroke) -> Stroke:
        """
        Return the stroke that the next frame of panels shall see, of one that comes with `hear`.

        MARK is among its keys while the panels shall see it down.
        """
        with self._lock:
            if not self._is_typing and not self._strokes.is_changing_page:
                return self._strokes.skip(told)
            return self._strokes.show(told)

    def hear(self, source: object, down: frozenset[int], mouse: Mouse = IDLE) -> Mouse:
        """
        Take what a browser sends with each picture that it draws: the keys that are down, a mouse.

        Returns the mouse as the next frame of panels shall see it.
        """
        with self._lock:
            self._step()
            is_new = source is not self._source
            if is_new:
                self._end_life()
                self._source = source
                self._pictures.clear()
                self._strokes.change_page()
            if self._life.age > GONE:
                self._keys.ignore_down()
            if not self._life.is_alive:
                self._clicks.forget()
            if is_new and not mouse.buttons:
                self._clicks.change_page()
            now = self._clock()
            since = now - self._pictures[-1] if self._pictures else 0.0
            before = self._clicks.shown.buttons
            waits = self._is_typing and not self._strokes.is_seen
            shown = self._clicks.show(mouse, since, waits, self.e_stop)
            is_free = not mouse.buttons and not shown.buttons and self._clicks.is_seen
            self.are_several = not SEVERAL.isdisjoint(down) or (self.are_several and not is_free)
            # What tells of a press proves a click, as it does a key's; what is held it does not.
            is_press = not before and not self._mouse.buttons and self._life.age <= GONE
            age = min(self._life.age, LOSS) if is_press else self._life.age
            self._silence = max(self._silence, age) if shown.buttons else 0.0
            self._keys.report(down, since, self._is_typing)
            self._life.hear()
            self._presence.hear()
            self._pictures.append(now)
            self.has_clicked |= shown.buttons != before
            if down or mouse.buttons or mouse.place != self._mouse.place:
                self.turns.touch()
            self._mouse = mouse
            self._undrawn = True
            # Each needless wake-up would cost the simulation a change of threads.
            if self.has_clicked or not self._is_resting:
                self._lock.notify_all()
            return shown

    def watch(self, source: object) -> None:
        """Take that a browser is shown the scene."""
        with self._lock:
            self._watchers.add(source)

    def lose(self, source: object) -> None:
        """Take that a browser's connection has ended."""
        with self._lock:
            self._watchers.discard(source)
            if source is self._source:
                self._end_life()
                self._source = None

    def press_e_stop(self) -> int:
        """Press the E-STOP on a page without control; it is the returned one of `stops_taken`."""
        with self._lock:
            self._stops += 1
            return self._stops

    def set_typing(self, is_typing: bool) -> None:
        """Take whether the keys are for a field of text on the page."""
        with self._lock:
            if is_typing and not self._is_typing:
                self._keys.ignore_down()
            elif self._is_typing and not is_typing:
                # What no frame has seen was not for the field.
                self._keys.heed(self._strokes.unseen)
            self._is_typing = is_typing

    def rest(self, seconds: float) -> None:
        """Wait for a time [s], or until a button of the mouse has gone down or up."""
        with self._lock:
            self._is_resting = True
            self._lock.wait_for(lambda: self.has_clicked, max(seconds, 0.0))
            self._is_resting = False

    def wait_for_picture(self, timeout: float) -> bool:
        """
        Wait at most `timeout` [s] for the browser to have drawn another picture.

        Only then is it sent a new one: what it cannot take would queue, and be old when shown.
        """
        with self._lock:
            self._lock.wait_for(lambda: self._undrawn, timeout)
            undrawn, self._undrawn = self._undrawn, False
            return undrawn

    def take_keys(self) -> list[str]:
        """
        Return presses, repeats, HELD and RELEASE since the last call, in order.

        LOST stands where the controlling browser had gone or fallen silent. The E-STOP of pages
        without control is the last.
        """
        with self._lock:
            self._step()
            is_stop, self.stops_taken = self._stops > self.stops_taken, self._stops
            return self._keys.take() + [_NAMES['Escape']] * is_stop

    def _step(self) -> None:
        """Let the time pass that has passed."""
        now = self._clock()
        dt, self._stepped = now - self._stepped, now
        was_present = self._presence.is_alive
        self._life.step(dt)
        self._presence.step(dt)
        if self._life.is_alive:
            self._keys.step(dt)
        elif was_present and not self._presence.is_alive:
            self._keys.lose()
            self._undrawn = False

    def _end_life(self) -> None:
        if self._source is not None:
            self._keys.lose()
            self._keys.ignore_down()
        self._life.reset()
        self._presence.reset()
        self._undrawn = False
        self.has_clicked = self.are_several = False
        self._clicks.forget()
        self._strokes.forget()


def _codes(*names: str) -> frozenset[int]:
    return frozenset(int(getattr(imgui.Key, name).value) for name in names)


# ImGui's number of a key -> its names without and with Shift.
PAGE_KEYS = {
    int(getattr(imgui.Key, key).value): (names[0], names[1]) for key, names in _CHARACTERS.items()
} | {int(getattr(imgui.Key, key).value): (name, f'SHIFT+{name}') for key, name in _NAMES.items()}
SHIFT = _codes('LeftShift', 'RightShift')
# With one of these down a key is a shortcut of the browser or the desktop, and not for a robot.
SHORTCUT = _codes('LeftCtrl', 'RightCtrl', 'LeftAlt', 'RightAlt', 'LeftSuper', 'RightSuper')

# The page's head holds this one down while several pointers are, two fingers or one and a mouse.
SEVERAL = _codes('F24')
ESCAPE = _codes('Escape')
# This one goes down or up with each stroke that a field of text is shown.
MARK = _codes('F23')
# These do something to what is typed in a field.
ACTS = _codes(
    'Enter', 'KeypadEnter', 'Tab', 'Escape', 'Backspace', 'Delete', 'Home', 'End'
) | _codes('LeftArrow', 'RightArrow', 'LeftCtrl', 'RightCtrl')


@dataclass
class _Down:
    """A key that is down: what it was called when it went down, for how long it is proved [s]."""

    name: str
    age: float = 0.0
    due: float = REPEAT_DELAY


class PageKeys:
    """
    Makes presses, repeats and releases of what a page reports to be down.

    One press comes per key that goes down, repeats as from a keyboard, `HELD+key` every
    `HELD_PERIOD` while it is down, `RELEASE+key` at its end. A key that is down when `lose` or
    `ignore_down` is called, or at the first report after the latter, counts again only after it
    was seen up. Nothing here looks at a clock.
    """

    def __init__(self) -> None:
        self._down: dict[int, _Down] = {}
        self._ghosts: set[int] = set()
        self._typed: set[int] = set()  # of these, what else would count
        self._is_fresh = True
        self._since_held = 0.0
        self._events: deque[str] = deque(maxlen=MOST_EVENTS)

    def report(self, down: Collection[int], dt: float, is_typing: bool = False) -> None:
        """
        Take which keys are down, by ImGui's numbers, `dt` [s] after the report before.

        A key that goes down while `is_typing` counts only once `heed` is told so.
        """
        self._ghosts &= set(down)
        self._typed &= set(down)
        if self._is_fresh:
            self._is_fresh = False
            self._ghosts |= set(down)
        for code in [code for code in self._down if code not in down]:
            self._events.append(with_event(RELEASE, self._down.pop(code).name))
        for key in self._down.values():
            self._repeat(key, min(max(dt, 0.0), LONGEST_PROOF))
        is_shortcut = not SHORTCUT.isdisjoint(down)
        is_shifted = not SHIFT.isdisjoint(down)
        for code in sorted(down):
            if code not in PAGE_KEYS or code in self._down or code in self._ghosts:
                continue
            if is_shortcut or is_typing:
                self._ghosts.add(code)
                if not is_shortcut:
                    self._typed.add(code)
            else:
                name = PAGE_KEYS[code][is_shifted]
                self._down[code] = _Down(name)
                self._events += [name, with_event(HELD, name)]

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass in which the page counts as alive."""
        self._since_held += max(dt, 0.0)
        if self._since_held >= HELD_PERIOD:
            self._since_held = 0.0
            self._events += [with_event(HELD, key.name) for key in self._down.values()]

    def ignore_down(self) -> None:
        """Release all keys, and let none that is down count until it was seen up."""
        self._release()
        self._is_fresh = True

    def heed(self, codes: frozenset[int]) -> None:
        """Let keys that were typed count while they are down; ESC if it is up again, too."""
        self._ghosts -= self._typed & codes
        self._events += [PAGE_KEYS[code][0] for code in ESCAPE & codes]

    def lose(self) -> None:
        """Note that nobody is there any more: LOST, and no key counts that was down."""
        self._events.append(LOST)
        self._release()

    def take(self) -> list[str]:
        """Return what came since the last call."""
        events = list(self._events)
        self._events.clear()
        return events

    def _release(self) -> None:
        self._events += [with_event(RELEASE, key.name) for key in self._down.values()]
        self._ghosts |= set(self._down)
        self._down.clear()
        self._typed.clear()

    def _repeat(self, key: _Down, proved: float) -> None:
        key.age += proved
        while key.age >= key.due:
            key.due += 1.0 / REPEAT_RATE
            self._events.append(key.name)
