# SPDX-License-Identifier: Apache-2.0
"""The signals that end or suspend a process, and an orderly shutdown."""

import atexit
from collections.abc import Callable, Iterator
import contextlib
import faulthandler
import gc
import os
import signal
import sys
import threading
import time
from types import FrameType
from typing import Any, ClassVar, NoReturn, Self

# Faults of the process itself: no handler of Python's would ever get to run.
FAULTS = (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL)
HARMLESS = (signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH)
SUSPENDING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
UNSTOPPABLE = (signal.SIGKILL, signal.SIGSTOP)
# All that would end a process on the spot, and that can be caught.
DEADLY = tuple(sorted(signal.valid_signals() - {*FAULTS, *HARMLESS, *SUSPENDING, *UNSTOPPABLE}))
# The sender of these wants the process to die of the signal, and to leave a core dump.
DUMPING = (signal.SIGQUIT, signal.SIGABRT, signal.SIGTRAP, signal.SIGSYS, signal.SIGXCPU)
# So long may a program take to let go of ROS [s].
GOODBYE = 10.0


class StopSignals:
    """
    Context in which deadly signals ask for a stop instead of killing the process.

    `requested` turns True at the first signal and `number` keeps it; the loop that owns the robot
    looks at it and leaves in order. Another SIGINT some seconds later raises KeyboardInterrupt:
    the way out of a shutdown that hangs. Sooner it means nothing, nor does it once the context is
    left: a held Ctrl-C repeats, and what it has ended is about to leave Python.

    Where nobody looks at `requested` in time, since the loop is stuck or has not begun, a thread
    calls the `last_words` and ends the process. What is ignored, as SIGHUP under nohup, stays so.
    """

    # The contexts we are in, for what cannot be handed one.
    entered: 'ClassVar[list[StopSignals]]' = []
    WATCHED = DEADLY
    # How long an orderly shutdown may take before Ctrl-C cuts it short [s].
    PATIENCE = 3.0
    # So often, and so many times, is it looked whether the loop has noticed [s]: counted, since
    # on a busy machine these looks, too, come late.
    LOOK_PERIOD = 0.05
    LOOKS = 12

    def __init__(self) -> None:
        self.number: int | None = None
        self.last_words: list[Callable[[], None]] = []
        self._is_noticed = False
        self._over = threading.Event()
        self._requested_at = 0.0
        self._previous: dict[int, Any] = {}

    @property
    def requested(self) -> bool:
        """Whether a stop has been asked for; who learns it, leaves."""
        self._is_noticed = self._is_noticed or self.number is not None
        return self.number is not None

    @property
    def exit_status(self) -> int:
        """Status to exit with: 0 for Ctrl-C, the normal way to leave, else 128 + signal."""
        return _status(self.number)

    def __enter__(self) -> Self:
        """Install the handlers, and the thread that sees to it that they have an effect."""
        self._over.clear()
        # At exit Python looks through all objects several times: with a robot's libraries, 0.5 s.
        atexit.unregister(gc.freeze)
        atexit.register(gc.freeze)
        for number in self.WATCHED:
            previous = signal.getsignal(number)
            always = number in (signal.SIGINT, signal.SIGTERM)
            if always or previous not in (signal.SIG_IGN, None):
                self._previous[number] = signal.signal(number, self._handle)
        reading, self._writing = os.pipe()
        os.set_blocking(self._writing, False)
        self._previous_wakeup = signal.set_wakeup_fd(self._writing, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._watch, args=(reading,), daemon=True)
        self._thread.start()
        self.entered.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        """Put back the handlers that were there; a Ctrl-C that ended us stays without effect."""
        self.entered.remove(self)
        for number, previous in self._previous.items():
            is_held = number == self.number == signal.SIGINT
            signal.signal(number, signal.SIG_IGN if is_held else previous)
        self._previous.clear()
        signal.set_wakeup_fd(self._previous_wakeup)
        self._over.set()
        os.close(self._writing)
        self._thread.join()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.number is None:
            self._requested_at = now
        elif number == signal.SIGINT and now - self._requested_at > self.PATIENCE:
            raise KeyboardInterrupt
        self.number = number

    def _watch(self, descriptor: int) -> None:
        """See to each signal, told by its number as soon as it came, whatever the loop does."""
        with os.fdopen(descriptor, 'rb', buffering=0) as arrivals:
            while arrived := arrivals.read(1):
                if arrived[0] in self._previous:
                    self._see_to(arrived[0])

    def _see_to(self, number: int) -> None:
        for _ in range(self.LOOKS):
            if self._is_noticed or self._over.wait(self.LOOK_PERIOD):
                return
        for say in self.last_words:
            with contextlib.suppress(Exception):
                say()
        os._exit(_status(number))


def stop_requested() -> bool:
    """Whether a stop signal came in the StopSignals context that we are in, if we are."""
    return any(stop.requested for stop in StopSignals.entered)


@contextlib.contextmanager
def letting_go() -> Iterator[None]:
    """
    Context in which a program lets go of ROS, or else is ended with status 1.

    Fast DDS waits there for a thread of its own, which it may starve (eProsima/Fast-DDS#6513). It
    holds Python's lock: neither Ctrl-C nor a thread of ours would get to run, so that faulthandler
    has to end it. A script that is not ours is let be: it may have more to do.
    """
    if not StopSignals.entered:
        yield
        return
    with open(os.devnull, 'w') as nowhere:
        faulthandler.dump_traceback_later(GOODBYE, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def _status(number: int | None) -> int:
    return 0 if number in (None, signal.SIGINT) else 128 + number


def leave(status: int) -> NoReturn:
    """
    End this process, whose work is done and closed, with an exit status.

    Fast DDS sleeps for 0.1 s among the destructors of a usual way out, and Python looks through
    all that it has.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def last_status(stop: StopSignals) -> int:
    """Die of a signal of DUMPING if one came; else return the exit status."""
    if stop.number in DUMPING:
        signal.signal(stop.number, signal.SIG_DFL)
        signal.raise_signal(stop.number)
    return stop.exit_status
