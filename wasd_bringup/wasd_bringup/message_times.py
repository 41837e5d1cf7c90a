# SPDX-License-Identifier: Apache-2.0
"""When a session looks after messages: often enough for time-outs, seldom enough for physics."""

import math

# Messages and services are looked after so often [s of wall time], but for no more than this
# share of it: a look at two dozen subscriptions takes milliseconds, on a busy machine many ...
PERIOD = 0.02
SHARE = 0.1
# ... unless simulated time has gone on by so much: time-outs are in it, the shortest 0.5 s [s].
LONGEST_PAUSE = 0.15


class MessageTimes:
    """
    Says when the next look at messages is due, by what the last one took.

    Where looks are slow, physics is what waits: a sender of 20 Hz must not seem silent. It reads
    no clock.
    """

    def __init__(self) -> None:
        self._soonest = self._affordable = -math.inf
        self._simulated = -math.inf

    def is_due(self, now: float, simulated: float) -> bool:
        """Whether to look, at a wall time [s] and a simulated time [s]."""
        is_starving = simulated >= self._simulated + LONGEST_PAUSE
        return now >= self._soonest and (is_starving or now >= self._affordable)

    def looked(self, now: float, took: float, simulated: float) -> None:
        """Note a look that ends now and took so long [s], waiting not counted."""
        self._soonest = now + PERIOD
        self._affordable = now + max(PERIOD, took / SHARE)
        self._simulated = simulated
