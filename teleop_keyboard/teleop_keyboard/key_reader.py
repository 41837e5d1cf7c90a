# SPDX-License-Identifier: Apache-2.0
"""Reads keys from the terminal or a pipe, and keeps them until there is a subscriber."""

from collections import deque
import contextlib
import os
import select
import stat
import sys
import time
from typing import Self

from wasd_core.timing import HELD, HELD_PERIOD, NO_PRESS, with_event

from teleop_keyboard.decoder import CharacterDecoder, KeyDecoder
from teleop_keyboard.keymap import SIGNAL_KEYS
from teleop_keyboard.terminal import NoTerminal, open_terminal, Source, Terminal
from teleop_keyboard.typed_keys import TypedKeys

# A key that names a state (of the Go2: 2 stands) means the same when it comes late [s]; longer,
# and whoever pressed it has given up or pressed another.
STATE_LIFETIME = 10.0
# Any other may move the robot: it counts while the finger may still be on it [s].
LIFETIME = 0.5
# More are not kept: the oldest go.
LIMIT = 20


class WaitingKeys:
    """Keeps keys, in order, until there is a subscriber or they are too old; reads no clock."""

    def __init__(self) -> None:
        self._keys: deque[tuple[str, float]] = deque(maxlen=LIMIT)

    def put(self, key: str) -> None:
        """Keep a key; what tells that one is down or was released is about now alone."""
        if not key.startswith(NO_PRESS):
            self._keys.append((key, 0.0))

    def step(self, dt: float) -> list[str]:
        """Let `dt` [s] pass; return the keys that are now too old."""
        older = [(key, age + max(dt, 0.0)) for key, age in self._keys]
        self._keys = deque((pair for pair in older if pair[1] <= _lifetime(pair[0])), LIMIT)
        return [key for key, age in older if age > _lifetime(key)]

    def take(self) -> list[str]:
        """Return what is kept, and forget it."""
        keys = [key for key, _ in self._keys]
        self._keys.clear()
        return keys

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._keys)


def _lifetime(key: str) -> float:
    return STATE_LIFETIME if key.isdecimal() else LIFETIME


# How long the rest of an escape sequence may take, so after what time ESC is just ESC [s].
SEQUENCE_TIMEOUT = 0.04
# While a key is down that may end by itself it is looked after so often [s].
DOWN_PERIOD = 0.02
# Text that nobody types is passed over for so long at once [s]: what is typed after it is heard
# soon, and the robot does not wait.
LONGEST_READ = 0.03
# What is only passed on, and drives nobody here, may come so fast.
LONGEST_BURST = 2000
IGNORED = 'pasted text was ignored (keys that are pressed drive)'


class KeyReader:
    """
    Context that reads keys from a terminal (raw while it lasts) and from a pipe, if given.

    `closed` turns True when no more key can come: the terminal hung up, or the pipe ended after it
    delivered something. A pipe that ends empty (what `ros2 launch` gives a node) leaves the
    terminal in charge.

    A terminal that speaks kitty's protocol tells releases, too: then a key that is down comes
    again as `HELD+key` every `HELD_PERIOD`, and its end as `RELEASE+key`. It is down while the
    terminal goes on telling; when it is lost, or brings text faster than a person types, all
    ends with STOP.
    """

    def __init__(self, terminal: Terminal | None, pipe: Source | None = None) -> None:
        self.terminal = terminal
        self.pipe = pipe
        self._decoders: dict[Source, KeyDecoder] = {}
        self._pending_since: dict[Source, float] = {}
        for source in (terminal, pipe):
            if source is not None:
                self._decoders[source] = KeyDecoder()
        self._typed = None if terminal is None else TypedKeys(self._decoders[terminal])
        self._stack = contextlib.ExitStack()
        self._is_raw = self._has_asked = False
        self._next_held = 0.0
        self._polled_at = time.monotonic()
        self._texts = 0

    @property
    def closed(self) -> bool:
        """Whether no more key can come."""
        if self._pending_since:
            return False
        if self.terminal is None:
            return self.pipe is None or self.pipe.closed
        ended = self.pipe is not None and self.pipe.closed and self.pipe.was_used
        return self.terminal.closed or ended

    @property
    def keys_can_wait(self) -> bool:
        """Whether the next keys are from a pipe: nobody holds them down."""
        return self.terminal is None or (self.pipe is not None and self.pipe.has_bytes)

    def __enter__(self) -> Self:
        """Enter raw mode on the terminal."""
        if self.terminal is not None:
            self._stack.enter_context(self.terminal)
            self.terminal.after_resume.append(self._begin_again)
        return self

    def __exit__(self, *_: object) -> None:
        """Give the terminal back."""
        self._stack.close()

    def undisturbed(self) -> contextlib.AbstractContextManager[None]:
        """Return a context in which keys are polled and acted upon before Ctrl-Z is."""
        return contextlib.nullcontext() if self.terminal is None else self.terminal.undisturbed()

    def poll(self, timeout: float) -> list[str]:
        """Wait at most `timeout` [s] of wall time for keys and return them in order."""
        if self.terminal is not None:
            self.terminal.notice_front()
        self._ask()
        # Reading another job's terminal would stop us.
        is_ours = self.terminal is None or self.terminal.is_ours
        sources = [
            each for each in self._decoders if not each.closed and (each is self.pipe or is_ours)
        ]
        now = time.monotonic()
        if self._pending_since:
            age = now - min(self._pending_since.values())
            timeout = min(timeout, max(SEQUENCE_TIMEOUT - age, 0.0))
        if self._down:
            timeout = min(timeout, DOWN_PERIOD)
        ready = select.select(sources, [], [], timeout)[0]
        keys = []
        if self.terminal is not None and self._typed is not None:
            keys += self._type(self.terminal, self._typed, self.terminal in ready)
        if self.pipe is not None and self.pipe in ready:
            keys += self._decoders[self.pipe].feed(self.pipe.read())
        for source in ready:
            self._note_pending(source, restart=True)
        oldest = time.monotonic() - SEQUENCE_TIMEOUT
        for source in [each for each, since in self._pending_since.items() if since <= oldest]:
            keys += self._decoders[source].flush()
            self._note_pending(source, restart=False)
        return self._with_held(keys)

    def take_notice(self) -> str:
        """Return once what the driver is to be told of the keys, '' for nothing."""
        texts = 0 if self._typed is None else self._typed.texts
        is_new, self._texts = texts != self._texts, texts
        return IGNORED if is_new else ''

    def _type(self, terminal: Terminal, typed: TypedKeys, is_ready: bool) -> list[str]:
        """Return what was typed on the terminal, and the end of what it tells no more of."""
        now = time.monotonic()
        dt, self._polled_at = now - self._polled_at, now
        keys = typed.take(terminal.read() if is_ready else b'', dt)
        # All of a text now: what is typed after it is to be heard.
        while typed.passes_over and time.monotonic() < now + LONGEST_READ:
            data = terminal.read()
            if not data:
                break
            keys += typed.take(data, 0.0)
        return keys

    def pass_on(self, raw: bool) -> None:
        """
        Pass bursts on whole, of LONGEST_BURST keys at most: programs type, too.

        They come as single characters if `raw`, else as names of keys.
        """
        self._is_raw = raw
        if raw:
            self._decoders = {source: CharacterDecoder() for source in self._decoders}
        if self.terminal is not None:
            self._typed = TypedKeys(self._decoders[self.terminal], LONGEST_BURST)

    @property
    def _down(self) -> tuple[str, ...]:
        return self._decoders[self.terminal].down if self.terminal is not None else ()

    def _ask(self) -> None:
        """Ask the terminal once whether it tells releases; have it do so when it does."""
        if self.terminal is None or self._is_raw:
            return
        self.terminal.bracket_pastes()
        if not self._has_asked:
            self._has_asked = True
            self.terminal.ask_kitty()
        if self._decoders[self.terminal].speaks_kitty:
            self.terminal.tell_releases()

    def _begin_again(self) -> None:
        """Forget and ask again: what was released while we were suspended the shell was told."""
        if self.terminal is not None:
            self._decoders[self.terminal].forget_down()
            self._decoders[self.terminal].speaks_kitty = self._has_asked = False

    def _with_held(self, keys: list[str]) -> list[str]:
        """Add that keys are down, after their presses and every now and then; make signals."""
        if self.terminal is None or not self.terminal.tells_releases:
            return keys
        now = time.monotonic()
        for key in keys:
            if key in SIGNAL_KEYS:
                # To the whole job, as the terminal would have done.
                os.killpg(os.getpgrp(), SIGNAL_KEYS[key])
        down = self._down
        if now >= self._next_held or any(key in down for key in keys):
            self._next_held = now + HELD_PERIOD
            keys = keys + [with_event(HELD, key) for key in down]
        return [key for key in keys if key not in SIGNAL_KEYS]

    def _note_pending(self, source: Source, *, restart: bool) -> None:
        if not self._decoders[source].pending:
            self._pending_since.pop(source, None)
        elif restart:
            self._pending_since[source] = time.monotonic()


def open_key_reader() -> KeyReader:
    """
    Return a reader of this process's terminal and, if standard input is a pipe, of that, too.

    Raises:
        NoTerminal: when there is neither.
    """
    pipe = Source(0) if _stdin_is_pipe() else None
    try:
        return KeyReader(open_terminal(), pipe)
    except NoTerminal:
        if pipe is None:
            raise
    return KeyReader(None, pipe)


def _stdin_is_pipe() -> bool:
    if sys.stdin is None:
        return False
    try:
        mode = os.fstat(0).st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or stat.S_ISREG(mode)
