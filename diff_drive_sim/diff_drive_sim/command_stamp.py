# SPDX-License-Identifier: Apache-2.0
"""What the stamp of a velocity command says of its age."""

from typing import NamedTuple

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
