# SPDX-License-Identifier: Apache-2.0
"""What tests of programs on pseudo-terminals share: bounds of time, waiting, frozen terminals."""

from collections.abc import Callable
import contextlib
import os
import signal
import time

# How long what must come may take on a busy machine [s]: no test asks how soon by this.
PATIENCE = 120.0
# The last command is zero so soon after the last key, and a process has ended so soon after a
# signal, whatever its terminal does [s].
ZERO_AFTER = 0.6
END_AFTER = 1.0
# Later than so many times its bound is late by itself, however busy the machine; and a little late
# so many times.
AT_MOST = 3.0
TRIES = 4


def wait_until(condition: Callable[[], bool], timeout: float = PATIENCE) -> float:
    """Wait until a condition holds, return when; fail after `timeout` [s]."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, 'waited in vain'
        time.sleep(0.005)
    return time.monotonic()


def assert_soon(take: Callable[[], float], bound: float) -> None:
    """
    Assert that something takes no longer than a bound [s]; a little late, it is tried again.

    A busy machine is late now and then, what is late by itself each time.
    """
    for left in reversed(range(TRIES)):
        took = take()
        if not left or not bound < took <= AT_MOST * bound:
            break
        print(f'{took:.3f} s, and again')
    assert took <= bound, f'took {took:.3f} s, at most {bound:.3f} s'


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
