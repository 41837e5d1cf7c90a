# SPDX-License-Identifier: Apache-2.0
"""A terminal in raw mode that is always given back as it was."""

from array import array
import atexit
from collections.abc import Callable, Iterator
import contextlib
import fcntl
import io
import os
import select
import signal
import sys
import termios
import threading
from types import FrameType
from typing import Any, Self, TextIO

from wasd_core.errors import UserError
from wasd_core.signals import DEADLY, SUSPENDING
from wasd_core.streams import open_own

# Indices into the list of termios.tcgetattr.
INPUT_FLAGS = 0
LOCAL_FLAGS = 3
CONTROL_CHARACTERS = 6

# Kitty's keyboard protocol: the question whether a terminal speaks it; on: releases, all keys as
# sequences, their text (1 + 2 + 8 + 16), and the loss of the focus; off again.
ASK_KITTY = b'\x1b[?u'
KITTY_ON = b'\x1b[>27u\x1b[?1004h'
KITTY_OFF = b'\x1b[?1004l\x1b[<u'
# What is pasted stands between brackets, and no longer.
PASTE_ON = b'\x1b[?2004h'
PASTE_OFF = b'\x1b[?2004l'

# One read takes everything that a terminal holds [bytes].
READ_SIZE = 65536


def read_ready(descriptor: int) -> bytes | None:
    """
    Return what is there, at most one buffer; None for nothing yet, b'' for the end.

    A terminal must be one whose reads do not wait (VMIN 0): Ctrl-Z empties it, maybe after it was
    found ready. What is at its end stays ready, and has nothing, again.
    """
    for _ in range(2):
        if not select.select([descriptor], [], [], 0.0)[0]:
            return None
        try:
            data = os.read(descriptor, READ_SIZE)
        except OSError:
            # EIO: the other side of a pseudo-terminal is gone.
            return b''
        if data:
            return data
    return b''


class NoTerminal(UserError):
    """There is no terminal to read keys from; says in one line what to do."""


class Source:
    """Bytes of keys, from a terminal, a pipe, a socket or a file."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.closed = False  # its end was read, or the terminal hung up
        self.was_used = False

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._descriptor

    @property
    def has_bytes(self) -> bool:
        """Whether there are bytes to read; the end of input has none."""
        count = array('i', [0])
        fcntl.ioctl(self._descriptor, termios.FIONREAD, count)
        return count[0] > 0

    def read(self) -> bytes:
        """Return what is there, at most one buffer, without waiting; b'' for nothing."""
        data = None if self.closed else read_ready(self._descriptor)
        self.closed = self.closed or data == b''
        self.was_used = self.was_used or bool(data)
        return data or b''


class Terminal(Source):
    """
    Context in which a terminal hands over each key as it is pressed, unechoed.

    Raw mode is entered once, without a flush, so no key is lost; signals (Ctrl-C, Ctrl-Z) and
    output processing stay on. The exact attributes found are put back when the context ends, when
    a deadly signal comes that nobody else handles, when the process is suspended, and at exit.
    `before_suspend` callables run before Ctrl-Z or a deadly signal stops the process,
    `after_resume` after `fg`. Nothing here waits for a terminal that takes no more output.
    """

    def __init__(self, descriptor: int, *, owns_descriptor: bool = False) -> None:
        super().__init__(descriptor)
        self._owns_descriptor = owns_descriptor
        self._outlet: int | None = None
        self._saved: list[Any] | None = None
        self._raw: list[Any] | None = None
        self._previous_handlers: dict[int, Any] = {}
        self._undo: list[bytes] = []  # what switches off what we have switched on
        self._is_busy = False
        self._is_asked_to_suspend = False
        self._was_ours = True
        self.before_suspend: list[Callable[[], None]] = []
        self.after_resume: list[Callable[[], None]] = []

    @property
    def is_ours(self) -> bool:
        """Whether its keys are for us; after `bg` they are the shell's."""
        return _is_foreground(self._descriptor)

    @property
    def tells_releases(self) -> bool:
        """Whether the terminal was told to report when a key is released."""
        return KITTY_OFF in self._undo

    def notice_front(self) -> None:
        """
        Go on where the shell has put us in front.

        Of a job that runs already bash's `fg` tells by no signal.
        """
        was_ours, self._was_ours = self._was_ours, self.is_ours
        if self._was_ours and not was_ours:
            self._resume(signal.SIGCONT, None)

    def ask_kitty(self) -> None:
        """Ask whether the terminal can report releases; the answer comes among the keys."""
        if self._raw is not None and not _is_dumb():
            self._write(ASK_KITTY)

    def tell_releases(self) -> None:
        """Ask the terminal to report releases, until the terminal is given back."""
        self._switch(KITTY_ON, KITTY_OFF)

    def bracket_pastes(self) -> None:
        """Ask the terminal to mark what is pasted, until the terminal is given back."""
        if not _is_dumb():
            self._switch(PASTE_ON, PASTE_OFF)

    def switch_off(self) -> None:
        """Switch off what was switched on, in the screen that it was switched on in."""
        undo, self._undo = self._undo, []
        self._write(b''.join(reversed(undo)))

    @contextlib.contextmanager
    def undisturbed(self) -> Iterator[None]:
        """
        Let Ctrl-Z wait until what was read has been acted upon.

        A key that was read before, and acted upon after `fg`, would move a robot by itself.
        """
        self._is_busy = True
        try:
            yield
        finally:
            self._is_busy = False
            is_asked, self._is_asked_to_suspend = self._is_asked_to_suspend, False
            if is_asked:
                self._suspend(signal.SIGTSTP, None)

    def __enter__(self) -> Self:
        """Enter raw mode, once in front, and watch the signals that would leave it behind."""
        termios.tcgetattr(self._descriptor)  # raises where there are none to give back
        self._outlet = open_own(self._descriptor)
        atexit.register(self.restore)
        if threading.current_thread() is threading.main_thread():
            self._install_handlers()
        self._was_ours = self.is_ours
        if self._was_ours:
            self._enter_raw_mode()
        return self

    def __exit__(self, *_: object) -> None:
        """Put back the attributes and the signal handlers that were there."""
        self.restore()
        atexit.unregister(self.restore)
        ours = (self._suspend, self._resume, self._act_by_default)
        for number, previous in self._previous_handlers.items():
            if signal.getsignal(number) in ours:
                signal.signal(number, previous)
        self._previous_handlers.clear()
        self._saved = None
        if self._outlet is not None:
            os.close(self._outlet)
            self._outlet = None
        if self._owns_descriptor:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)

    def restore(self) -> None:
        """
        Put back the attributes found at the start; harmless when called twice.

        What somebody else has set since, a shell that took its terminal back, stays.
        """
        raw, self._raw = self._raw, None
        if raw is None:
            return
        self.switch_off()
        # A terminal that is gone has no attributes to keep.
        with contextlib.suppress(termios.error, OSError):
            if self.is_ours or termios.tcgetattr(self._descriptor) == raw:
                self._set_attributes(self._saved)

    def _set_attributes(self, attributes: list[Any] | None) -> None:
        """Set attributes now, not when all is shown: a frozen terminal never gets there."""
        # From behind, too: the signal that asks who is in front would stop us.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGTTOU,))
        try:
            termios.tcsetattr(self._descriptor, termios.TCSANOW, attributes or [])
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _switch(self, on: bytes, off: bytes) -> None:
        # Behind another job, after `bg`, the terminal is not ours to change.
        if self._raw is not None and off not in self._undo:
            self._undo.append(off)
            self._write(on)

    def _write(self, data: bytes) -> None:
        # Not a terminal that can be written to, or not any more: then it stays as it is.
        if self._outlet is not None and data:
            with contextlib.suppress(OSError):
                os.write(self._outlet, data)

    def _enter_raw_mode(self) -> None:
        # Of one that hung up reading tells.
        with contextlib.suppress(termios.error, OSError):
            if self._saved is None:
                self._saved = termios.tcgetattr(self._descriptor)
            saved = self._saved
            raw = [*saved[:CONTROL_CHARACTERS], list(saved[CONTROL_CHARACTERS])]
            # IXON and IEXTEN would swallow Ctrl-S, Ctrl-Q and Ctrl-V; ICRNL hide what ENTER is.
            raw[INPUT_FLAGS] &= ~(termios.IXON | termios.ICRNL | termios.INLCR | termios.IGNCR)
            raw[LOCAL_FLAGS] &= ~(termios.ICANON | termios.ECHO | termios.IEXTEN)
            raw[CONTROL_CHARACTERS][termios.VMIN] = 0  # read_ready tells why
            raw[CONTROL_CHARACTERS][termios.VTIME] = 0
            self._set_attributes(raw)
            self._raw = termios.tcgetattr(self._descriptor)

    def _install_handlers(self) -> None:
        wanted: dict[int, Any] = dict.fromkeys(SUSPENDING, self._suspend)
        wanted[signal.SIGCONT] = self._resume
        for deadly in DEADLY:
            # A signal that the program handles itself (StopSignals) keeps its handler.
            if signal.getsignal(deadly) == signal.SIG_DFL:
                wanted[deadly] = self._act_by_default
        for number, handler in wanted.items():
            self._previous_handlers[number] = signal.signal(number, handler)

    def _act_by_default(self, number: int, frame: FrameType | None) -> None:
        for callback in self.before_suspend:
            callback()
        self.restore()
        signal.signal(number, signal.SIG_DFL)
        # To this thread: a signal to the process could be taken by another one, later.
        signal.pthread_kill(threading.get_ident(), number)

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        # Only Ctrl-Z may wait: who is behind is asked again and again until it stops.
        if self._is_busy and number == signal.SIGTSTP:
            self._is_asked_to_suspend = True
            return
        self._act_by_default(number, frame)
        # The process stops here and goes on after SIGCONT; without a shell it does not stop.
        signal.signal(number, self._suspend)
        self._resume(number, frame)

    def _resume(self, number: int, frame: FrameType | None) -> None:
        # After `bg` the terminal belongs to the shell; `fg` sends a second SIGCONT, or none.
        self._was_ours = self.is_ours
        if self._was_ours:
            self._enter_raw_mode()
            for callback in self.after_resume:
                callback()


def open_terminal() -> Terminal:
    """
    Return the terminal of this process: standard input, or else the controlling terminal.

    Raises:
        NoTerminal: when there is none, or when it belongs to another job of the shell.
    """
    if sys.stdin is not None and os.isatty(0):
        return Terminal(0)
    try:
        descriptor = os.open('/dev/tty', os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError:
        raise NoTerminal(
            'no terminal to read keys from; run it in a terminal or pipe keys into it'
        ) from None
    if not _is_foreground(descriptor):
        os.close(descriptor)
        raise NoTerminal('the terminal belongs to another job; run it in the foreground')
    return Terminal(descriptor, owns_descriptor=True)


def understands_escapes(stream: TextIO) -> bool:
    """Whether a text may move the cursor and set colours where a stream goes."""
    return stream.isatty() and not _is_dumb()


def may_draw_on(stream: TextIO) -> bool:
    """Whether what stands where a stream goes is ours to rewrite; after `bg` it is not."""
    try:
        return _is_foreground(stream.fileno())
    except OSError:
        # No file of the system's.
        return True


def tolerate_any_text() -> None:
    """Let standard output show what its encoding lacks as `?`, instead of failing."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors='replace')


def _is_dumb() -> bool:
    return os.environ.get('TERM', 'dumb') == 'dumb'


def _is_foreground(descriptor: int) -> bool:
    """Whether changing this terminal would not stop us with SIGTTOU."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        # Not our controlling terminal: no job control between us. Or it hung up: reading tells.
        return True
