# SPDX-License-Identifier: Apache-2.0
"""
A key that is held in a terminal with Kitty's keyboard protocol, whose link then falls silent.

The terminal says before, during or after the first press that it tells releases. What is timed is
from the last that it tells to the first command to stand, in a subscriber of another process.
"""

from collections.abc import Iterator
import contextlib
import math
import os
import time

from table import format_count, Row
from typist import Typist

PRESS, REPEAT, ANSWER = b'\x1b[105;;105u', b'\x1b[105;1:2;105u', b'\x1b[?0u'
# When the terminal says so, after the first press [s]: before it, before its repeats, after them.
ANNOUNCED = {'before': math.nan, 'during': 0.2, 'after': 1.05}
# How long a key is held, when its repeats begin and how far apart they are [s].
HELD, DELAY, PERIOD = 1.0, 0.3, 1.0 / 30.0
# What each must end within, of a key with repeats and of one without; how long it is watched [s].
ENDS = {'held for 1 s': 0.4, 'pressed once': 0.7}
WATCHED = 1.6


@contextlib.contextmanager
def teleop() -> Iterator[Typist]:
    """Yield a teleoperation on a terminal that has said nothing yet."""
    typist = Typist('teleop_keyboard.teleop_node')
    try:
        typist.find_each_other()
        yield typist
    finally:
        typist.close()


def press(typist: Typist, announced: float, held: float) -> float:
    """
    Press a key and repeat it for `held` [s]; return how soon after that it is told to stand [s].

    Infinite for one that is told to stand before, or that does not drive.
    """
    told = [(0.0, PRESS)]
    told += [(DELAY + n * PERIOD, REPEAT) for n in range(int((held - DELAY) / PERIOD))]
    said = [] if math.isnan(announced) else [(announced, ANSWER)]
    typist.moves.clear()
    typist.stops.clear()
    begin = last = time.monotonic()
    for when, data in sorted(told + said):
        time.sleep(max(0.0, begin + when - time.monotonic()))
        os.write(typist.master, data)
        last = last if data == ANSWER else time.monotonic()
    time.sleep(WATCHED)
    stops = [stop for stop in typist.stops if typist.moves and stop > typist.moves[0]]
    if not stops or stops[0] < max(last, typist.moves[-1]):
        return math.inf
    return stops[0] - last


def presses(announced: float, count: int) -> Iterator[tuple[float, float]]:
    """Yield how soon a key ends that was held, and then one that was pressed once, [s]."""
    if math.isnan(announced):
        with teleop() as typist:
            os.write(typist.master, ANSWER)
            for _ in range(count):
                yield press(typist, announced, HELD), press(typist, math.nan, 0.0)
        return
    for _ in range(count):
        with teleop() as typist:
            yield press(typist, announced, HELD), press(typist, math.nan, 0.0)


def measure_told_keys(count: int) -> list[Row]:
    """Return the rows: of each announcement so many keys with repeats, and as many without."""
    found = [(word, both) for word, at in ANNOUNCED.items() for both in presses(at, count)]
    rows = []
    for kind, (what, limit) in enumerate(ENDS.items()):
        delays = [both[kind] for _, both in found]
        good = sum(delay <= limit for delay in delays)
        rows.append(
            Row(
                what=f'teleop: a key {what}, then silence: until it is told to stand',
                measured=f'{format_count(good, len(delays))}, {1e3 * max(delays):.0f} ms at worst',
                must=f'<= {1e3 * limit:g} ms: all',
                passed=good == len(delays),
                trials=[
                    {'announced': word, 'value': round(1e3 * both[kind], 1), 'unit': 'ms'}
                    for word, both in found
                ],
            )
        )
    return rows
