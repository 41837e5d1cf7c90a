# SPDX-License-Identifier: Apache-2.0
"""The dead man's switch: signs of held keys (docs/keyboard.md), timers that read no clock."""

import math
from typing import NamedTuple

HELD = 'HELD'
RELEASE = 'RELEASE'
# Stands among the keys where their driver has gone or fallen silent.
LOST = 'LOST'
# How all begin that are no press.
NO_PRESS = (f'{HELD}+', f'{RELEASE}+')
# No keyboard sends it: a program does, when the driver is gone. It ends what keys set moving.
STOP_KEY = 'STOP'
# How often it is told that a key is still down, where its release is told [s].
HELD_PERIOD = 0.1
# Repeats of a key that is held, as keyboards send them [Hz].
REPEAT_RATE = 30.0
# Scripts, the page's stick and the navigator repeat their velocities at this rate [Hz].
TWIST_RATE = 20.0

# Names for characters that a file format cannot hold as themselves.
ALIASES = {'SPACE': ' '}


def split_event(name: str) -> tuple[str, str]:
    """Return what a name tells, HELD, RELEASE or '' for a press, and of which key."""
    for start in NO_PRESS:
        if name.startswith(start) and len(name) > len(start):
            key = name[len(start) :]
            return start[:-1], ALIASES.get(key, key)
    return '', name


def with_event(event: str, key: str) -> str:
    """Return the name of a message that tells HELD or RELEASE of a key."""
    return f'{event}+{"SPACE" if key == " " else key}'


def is_press(key: str) -> bool:
    """Return whether a message on `keys` is a press, not the HELD or RELEASE of one."""
    return bool(key) and not split_event(key)[0]


class Watchdog:
    """
    The time since a source was last heard, and whether it still counts.

    It reads no clock: `step` is told what has really passed [s], however much that is, so a
    stopped process that goes on, a slow topic or a coarse period cannot stretch the time-out.
    A source that was never heard is dead. A time-out of 0 or less never ends what was heard.
    """

    def __init__(self, timeout: float) -> None:
        """Take the time-out [s]; it may be changed while the source is alive."""
        self.timeout = timeout
        self.age = math.inf

    @property
    def is_alive(self) -> bool:
        """Whether the source was heard, and not longer ago than the time-out."""
        return math.isfinite(self.age) and not self.age > self.timeout > 0.0

    def hear(self, age: float = 0.0) -> None:
        """Note a sign of life that is `age` [s] old."""
        self.age = age

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass; a time that runs backwards does not make the source younger."""
        self.age += max(dt, 0.0)

    def reset(self) -> None:
        """Forget that the source was ever heard."""
        self.age = math.inf


# How long a text stands [s].
READING_TIME = 3.0


class Notice:
    """
    The last remark to the user, until it is old.

    It reads no clock: `step` is told what has passed [s]. A text begins with what is to be done;
    what explains it stands in parentheses at the end, and is left out first (`brief`).
    """

    def __init__(self) -> None:
        self._text = ''
        self._fresh = Watchdog(READING_TIME)

    @property
    def text(self) -> str:
        """What is to be read now; '' when there is nothing, or nothing any more."""
        return self._text if self._fresh.is_alive else ''

    def say(self, text: str | None) -> bool:
        """Show a text from now on, or none; return whether it is one that was not being shown."""
        is_new = bool(text) and text != self.text
        self._text = text or ''
        self._fresh.hear()
        return is_new

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._fresh.step(dt)


def brief(text: str) -> str:
    """Return a text without the explanation in parentheses at its end."""
    return text[: text.rindex(' (')] if text.endswith(')') and ' (' in text else text


# Sums of periods miss the instant that they mean by some rounding [s].
ROUNDING = 1e-6


class Beat:
    """
    Picks the first instant of each period, counted from time 0, not from the first call.

    Nodes that see the same times pick the same ones, so what they publish has one stamp.
    """

    def __init__(self) -> None:
        self.number = -1  # of the period that was seen last; no time is before 0

    def is_due(self, now: float, rate: float) -> bool:
        """Whether to publish at a time [s], `rate` times a second; also after a jump back."""
        number = math.floor((now + ROUNDING) * rate)
        before, self.number = self.number, number
        return number != before


# A process that does nothing for so long was stopped or starved [s of wall time] ...
SHORTEST_ABSENCE = 0.5
# ... and so long after it messages from before may still come, sent again by the middleware [s].
AFTERMATH = 10.0


class Absence:
    """
    The last pause of this process, and whether a message was sent before its end.

    A Twist has no stamp: out of a queue that waited for a stopped process it looks like new. The
    middleware tells when it was sent, by the clock of its sender. How far that clock is off is
    the least difference between sending and receiving seen so far. It reads no clock.
    """

    def __init__(self) -> None:
        self._lived_at = math.inf
        self._returned_at = -math.inf
        self._offset = math.inf

    def beat(self, now: float) -> float:
        """Note a sign of our own life at a time [s]; return how long we were absent [s], or 0."""
        gap, self._lived_at = now - self._lived_at, now
        if gap < SHORTEST_ABSENCE:
            return 0.0
        self._returned_at = now
        return gap

    def is_stale(self, sent: float, now: float) -> bool:
        """Whether a message that is received now was sent before our last return [s]."""
        known = self._offset if self._offset < math.inf else 0.0
        self._offset = min(self._offset, now - sent)
        since = now - self._returned_at
        return since < AFTERMATH and sent + min(known, self._offset) < self._returned_at


# A clock that is ahead by less than this [s] is no news.
AHEAD = 0.1


class StampVerdict(NamedTuple):
    """The age of a command [s], None for one to be dropped, and what is odd about it."""

    age: float | None
    note: str = ''


def judge_stamp(stamp: float, now: float, timeout: float) -> StampVerdict:
    """
    Judge a stamp [s] at a time [s].

    A stamp of zero is none: the command is of now. One older than the time-out is dropped, and
    where there is a time-out a younger one has used up some of it. One from the future is of now,
    too: a sender whose clock is ahead must not outlive the time-out.
    """
    if stamp == 0.0:
        return StampVerdict(0.0, 'has no stamp: taken as of now')
    age = now - stamp
    if age < 0.0:
        note = f'is stamped {-age:.3f} s ahead of this clock: taken as of now'
        return StampVerdict(0.0, note if -age > AHEAD else '')
    if age > timeout > 0.0:
        note = f'is {age:.3f} s old, more than cmd_vel_timeout {timeout:g} s: dropped'
        return StampVerdict(None, note)
    return StampVerdict(age)
