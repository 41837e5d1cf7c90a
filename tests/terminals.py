# SPDX-License-Identifier: Apache-2.0
"""What tests of programs on pseudo-terminals share: bounds of time, waiting, frozen terminals."""

from collections.abc import Callable
import contextlib
import os
from pathlib import Path
import signal
import subprocess
import time
from typing import Any

# How long what must come may take on a busy machine [s]: no test asks how soon by this.
PATIENCE = 120.0
# The last command is zero so soon after the last key, and a process has ended so soon after a
# signal, whatever its terminal does [s].
ZERO_AFTER = 0.6
END_AFTER = 1.0


def wait_until(condition: Callable[[], bool], timeout: float = PATIENCE) -> float:
    """Wait until a condition holds, return when; fail after `timeout` [s]."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, 'waited in vain'
        time.sleep(0.005)
    return time.monotonic()


class Stopwatch:
    """
    Says how long something takes a process and the one that looks, from the making of this on.

    Not counted is what they wait for a processor with work at hand: that is the busy machine's.
    """

    def __init__(self, pid: int) -> None:
        self._pids = (pid, os.getpid())
        self._first = self._look()
        self._last = dict(self._first)
        self.began = time.time()

    @property
    def waited(self) -> float:
        """How long they have waited for a processor [s]."""
        self._last |= self._look()
        nanoseconds = (last - self._first.get(each, 0) for each, last in self._last.items())
        return 1e-9 * sum(nanoseconds)

    def took(self, until: float) -> float:
        """Return how long it has taken until a time of `time.time()` [s]."""
        return until - self.began - self.waited

    def wait_until(self, condition: Callable[[], bool]) -> float:
        """Wait until a condition holds; return how long that took [s]."""

        def holds() -> bool:
            self._last |= self._look()  # at threads that end, too
            return condition()

        wait_until(holds)
        return self.took(time.time())

    def _look(self) -> dict[str, int]:
        """Return how long each thread has waited for a processor [ns], by its number."""
        waited = {}
        for pid in self._pids:
            for path in Path(f'/proc/{pid}/task').glob('*/schedstat'):
                with contextlib.suppress(OSError):  # it has just ended
                    waited[path.parent.name] = int(path.read_text().split()[1])
        return waited


def end_by(process: 'subprocess.Popen[Any]', number: int) -> None:
    """Send a signal; check how soon the process ends, and its status."""
    stopwatch = Stopwatch(process.pid)
    process.send_signal(number)
    state = os.WEXITED | os.WNOHANG | os.WNOWAIT
    took = stopwatch.wait_until(lambda: os.waitid(os.P_PID, process.pid, state) is not None)
    print(f'{name_of(number)}: {took:.2f} s')
    assert process.wait() in usual_statuses(number)
    assert took <= END_AFTER, f'took {took:.3f} s'


def fill(slave: int) -> None:
    """Leave no room on a terminal for another byte; whoever reads from it makes room again."""
    filler = os.open(os.ttyname(slave), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    has_grown = True
    while has_grown:  # the system passes bytes on behind our back, which makes room again
        has_grown = False
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(filler, b'.')
                has_grown = True
        time.sleep(0.1)
    os.close(filler)


def name_of(number: int) -> str:
    """Return what a signal is called."""
    return getattr(number, 'name', str(number))


def usual_statuses(number: int) -> tuple[int, ...]:
    """Return the statuses that a shell shows for a signal."""
    return (0,) if number == signal.SIGINT else (-number, 128 + number)
