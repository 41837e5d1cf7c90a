# SPDX-License-Identifier: Apache-2.0
"""How often readings come, and whether that is enough to walk."""

from collections import deque
from collections.abc import Iterable
from itertools import islice

# So many intervals are looked at: a tenth of a second at the usual rate.
INTERVALS = 50
# Fewer say nothing: a stream that has just been found may begin with a gap.
FEWEST = 10
# A longer interval counts as so many that are wanted: one gap alone makes no slow stream.
LONGEST = 10.0
# What comes slowly does so now: most of so many last intervals are too long. Gaps, as a busy
# machine or a process that was stopped leaves them, make no slow stream.
LAST = 7
# A stream of less than this share of the rate that is wanted is too slow.
ENOUGH = 0.8
# A robot at rest is hindered only after readings were slow for this long [s]: a simulator does
# not wait for a controller before its first answer, and states may get lost until then.
SLOW_AT_REST = 1.0
# A moving robot stops after this time [s]: readings that a busy machine loses for a moment do no
# harm.
SLOW_IN_MOTION = 0.05


class Feed:
    """
    The rate of a stream of readings, by their stamps.

    A controller that is fed too slowly answers states that are gone, and the robot falls. It reads
    no clock.
    """

    def __init__(self, wanted: float) -> None:
        """Take the rate that is wanted [Hz]."""
        self.wanted = wanted
        self._intervals: deque[float] = deque()
        self._cut = 0.0  # sum of the intervals, none of them longer than allowed
        self._last: float | None = None

    def take(self, stamp: float) -> None:
        """Take a reading's stamp [s]; one that is before the last begins a new stream."""
        previous, self._last = self._last, stamp
        if previous is None or stamp == previous:
            return
        if stamp < previous:
            self._intervals.clear()
            self._cut = 0.0
            return
        longest = LONGEST / self.wanted
        if len(self._intervals) == INTERVALS:
            self._cut -= min(self._intervals.popleft(), longest)
        self._intervals.append(stamp - previous)
        self._cut += min(stamp - previous, longest)

    @property
    def rate(self) -> float:
        """Readings a second [Hz]; 0 while too few have come."""
        count = len(self._intervals)
        return count / sum(self._intervals) if count >= FEWEST else 0.0

    @property
    def is_slow(self) -> bool:
        """Whether it is known to come too slowly."""
        count = len(self._intervals)
        if count < FEWEST or count >= ENOUGH * self.wanted * self._cut:
            return False
        last = sorted(islice(reversed(self._intervals), LAST))
        return last[LAST // 2] > 1.0 / (ENOUGH * self.wanted)


class Feeds:
    """
    The streams of readings that a controller needs: it moves only while none is too slow.

    `hindrance` says which one is, with the cure, in one line; '' while all come often enough.
    """

    def __init__(self, topics: Iterable[str], wanted: float, whose: str) -> None:
        """Take topics, the rate that is wanted of each [Hz], and `whose` it is, in words."""
        self.by_topic = {topic: Feed(wanted) for topic in topics}
        self._wanted, self._whose = wanted, whose
        self._slow_for = 0.0  # readings have come too slowly for so long [s]
        self.hindrance = ''

    def take(self, topic: str, stamp: float) -> None:
        """Take the stamp of a reading [s]; ignore a topic that is not needed."""
        if topic in self.by_topic:
            self.by_topic[topic].take(stamp)

    def judge(self, gap: float, rests: bool) -> None:
        """Judge `gap` [s] after the last time; one that `rests` has more patience."""
        slow = [topic for topic, feed in self.by_topic.items() if feed.is_slow]
        self._slow_for = self._slow_for + gap if slow else 0.0
        if not slow:
            self.hindrance = ''
        elif not self.hindrance and self._slow_for > (SLOW_AT_REST if rests else SLOW_IN_MOTION):
            rate, wanted = self.by_topic[slow[0]].rate, self._wanted
            self.hindrance = (
                f'{slow[0]} comes at {rate:.0f} Hz, wanted {wanted:g} ({self._whose}): it does '
                f'not move; start the simulator with state_rate:={wanted:.1f}'
            )
