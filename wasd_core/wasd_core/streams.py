# SPDX-License-Identifier: Apache-2.0
"""
Standard output and standard error of our programs, and what of a text reaches a terminal.

`prepare_streams` comes first in every program; then text reaches a terminal with its control
characters made visible, and an output that fails is one line. `never_wait` comes first in what
drives a robot: from there on a reader who does not read costs text, not time.
"""

from collections.abc import Iterator, Sequence
import contextlib
import errno
import io
import os
import select
import stat
import sys
import time
from typing import Any, TextIO
import unicodedata

# Control characters, formats (bidi overrides, invisible marks), halves of pairs, breaks of lines.
UNSEEN = frozenset(('Cc', 'Cf', 'Cs', 'Zl', 'Zp'))
# Joiners belong to words of many scripts and to emojis; they steer nothing.
JOINERS = '\u200c\u200d'


def visible(text: str, kept: str = '') -> str:
    r"""
    Return a text in which no character acts on a terminal: ESC as `^[`, U+009B as `\x9b`.

    Blanks are the only space left: a line break becomes `^J`, so one line stays one line. What is
    `kept` stays as it is.
    """
    if text.isascii() and text.isprintable():
        return text
    return ''.join(one if one in kept else _visible(one) for one in text)


def _visible(one: str) -> str:
    code = ord(one)
    if code < 0x20 or code == 0x7F:
        return '^' + chr(code ^ 0x40)
    if one in JOINERS or unicodedata.category(one) not in UNSEEN:
        return one
    return one.encode('unicode_escape').decode('ascii')


# How long a line of text may wait for a reader before it is dropped [s].
PATIENCE = 0.2
# Written at most at a time where a write might wait [bytes]: pipes and terminals have that room.
SMALL = 512


class OutputLost(Exception):
    """Standard output takes nothing more: its reader has gone, or the disk is full."""

    def __init__(self, error: OSError) -> None:
        super().__init__(error.strerror)
        self.errno = error.errno


class Outlet(io.RawIOBase):
    """
    A descriptor to write to: all that is given, or else, once `drops`, none of it.

    What finds no room in time is dropped as a whole. Of what was begun the rest comes before
    anything else: half an escape sequence would garble what follows.
    """

    def __init__(self, descriptor: int, is_vital: bool = False) -> None:
        self._descriptor = descriptor
        self._is_vital = is_vital
        self._rest = b''
        self._is_stuck = False
        self._at_most: int | None = None
        self.drops = False

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return os.isatty(self._descriptor)

    def writable(self) -> bool:
        """Return True."""
        return True

    def never_wait(self) -> None:
        """Drop from now on what finds no room in PATIENCE [s]."""
        self.drops = True
        own = open_own(self._descriptor)
        if own is not None:
            os.dup2(own, self._descriptor)
            os.close(own)
        elif _may_block(self._descriptor):
            self._at_most = SMALL

    def write(self, data: Any) -> int:
        """
        Write all; where it `drops`, wait at most PATIENCE [s] for room.

        Raises:
            OutputLost: from standard output that does not drop.
        """
        text = bytes(data)
        self.send(text, PATIENCE)
        return len(text)

    def send(self, data: bytes, patience: float) -> bool:
        """
        Write, waiting up to `patience` [s] for room; return whether the data was taken.

        Where the last wait was in vain there is none: many texts do not add up to a long time.
        """
        if not self._finish(patience):
            return False
        self._rest = data
        self._finish(patience)
        return True

    def _finish(self, patience: float) -> bool:
        deadline = time.monotonic() + (0.0 if self._is_stuck else patience)
        while self._rest:
            try:
                if self._at_most and not self._has_room(0.0):
                    raise BlockingIOError
                self._rest = self._rest[os.write(self._descriptor, self._rest[: self._at_most]) :]
                self._is_stuck = False
            except BlockingIOError:
                wait = deadline - time.monotonic() if self.drops else PATIENCE
                if self.drops and not (wait > 0.0 and self._has_room(wait)):
                    self._is_stuck = True
                    return False
                self._has_room(wait)
            except OSError as error:
                self._rest = b''
                if self._is_vital and not self.drops:
                    raise OutputLost(error) from None
        return True

    def _has_room(self, wait: float) -> bool:
        return bool(select.select([], [self._descriptor], [], wait)[1])


class Words(io.TextIOWrapper):
    """The text of a program; on a terminal its control characters are shown, not done."""

    def __init__(self, outlet: Outlet, encoding: str, errors: str) -> None:
        super().__init__(outlet, encoding, errors, write_through=True)  # type: ignore[arg-type]
        self.outlet = outlet
        self._is_terminal = outlet.isatty()

    def write(self, text: str) -> int:
        """Write a text, and it alone."""
        super().write(visible(text, '\n\t') if self._is_terminal else text)
        return len(text)


def prepare_streams() -> None:
    """Take charge of standard output and error, whatever they are; a closed one is /dev/null."""
    for descriptor in (0, 1, 2):
        _fill(descriptor)
    if sys.stdout is None or _is_python_s(sys.stdout, 1):
        sys.stdout = _words(sys.stdout, 1, 'strict')
    if sys.stderr is None or _is_python_s(sys.stderr, 2):
        sys.stderr = _words(sys.stderr, 2, 'backslashreplace')
    # Newer Pythons colour help and tracebacks; here these would be shown as sequences.
    os.environ.setdefault('PYTHON_COLORS', '0')


def never_wait() -> None:
    """
    Let no write to standard output or error wait long for a reader from now on.

    A terminal or pipe is opened again for that: the old opening is shared with the shell, which is
    not to find it changed. So ROS' log, which is written past us, does not wait either.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Words):
            stream.outlet.never_wait()


def offer(stream: TextIO, text: str, patience: float = 0.0) -> bool:
    """
    Write a program's own text, sequences as they are, if there is room within `patience` [s].

    Return whether it was taken; what was not is to be shown again later.
    """
    if isinstance(stream, Words):
        data = text.encode(stream.encoding, stream.errors or 'strict')
        return stream.outlet.send(data, patience)
    try:
        stream.write(text)
        stream.flush()
    except OSError:
        # The reader has gone; a robot is not to be left running for that.
        return False
    return True


@contextlib.contextmanager
def unguarded(stream: TextIO) -> Iterator[TextIO]:
    """Give the same output to a library that colours text which was made visible before."""
    if not isinstance(stream, Words):
        yield stream
        return
    plain = io.TextIOWrapper(
        stream.outlet,  # type: ignore[type-var]
        stream.encoding,
        stream.errors,
        write_through=True,
    )
    try:
        yield plain
    finally:
        plain.detach()  # it would close what it shares


def print_error(error: object) -> None:
    """Say in one line on standard error what is wrong."""
    print(f'error: {error}', file=sys.stderr)


def say_vain(words: Sequence[str]) -> None:
    """Say in one line on standard error which words of the command line are without effect."""
    if words:
        print(f'WARNING: without effect here: {", ".join(words)}', file=sys.stderr, flush=True)


def lost_output(error: OutputLost) -> int:
    """Return the exit status of a program that lost its output: 0 where `| head` had enough."""
    if error.errno == errno.EPIPE:
        return 0
    print_error(f'standard output: {error}')
    return 1


def open_own(descriptor: int) -> int | None:
    """
    Return a new opening of a terminal or pipe that never waits; None where there cannot be one.

    It is the caller's to close.
    """
    if not _may_block(descriptor):
        return None
    flags = os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
    # A terminal of another user's, as after `su`, can be opened under its other name only.
    for name in (f'/proc/self/fd/{descriptor}', '/dev/tty'):
        try:
            own = os.open(name, flags)
        except OSError:
            continue
        if os.isatty(own) == os.isatty(descriptor):
            return own
        os.close(own)
    return None


def _may_block(descriptor: int) -> bool:
    try:
        mode = os.fstat(descriptor).st_mode
    except OSError:
        return False
    return os.isatty(descriptor) or stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)


def _fill(descriptor: int) -> None:
    """Open /dev/null on a closed descriptor, or the next file opened would get it."""
    try:
        os.fstat(descriptor)
    except OSError:
        null = os.open(os.devnull, os.O_RDWR)
        if null != descriptor:
            os.dup2(null, descriptor)
            os.close(null)


def _is_python_s(stream: TextIO, descriptor: int) -> bool:
    """Whether a stream is the one that Python made for a descriptor, not a test's."""
    if isinstance(stream, Words):
        return False
    try:
        return stream.fileno() == descriptor
    except (OSError, ValueError):
        return False


def _words(stream: TextIO | None, descriptor: int, errors: str) -> Words:
    outlet = Outlet(descriptor, is_vital=descriptor == 1)
    if stream is None:
        return Words(outlet, 'utf-8', errors)
    stream.flush()
    return Words(outlet, stream.encoding, stream.errors or errors)
