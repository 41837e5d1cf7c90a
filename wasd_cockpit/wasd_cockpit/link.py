# SPDX-License-Identifier: Apache-2.0
"""What goes between the simulation's thread and the page's: snapshots there, orders back."""

from collections import deque
from collections.abc import Callable
import time
from typing import NamedTuple

from wasd_cockpit.snapshot import Order
from wasd_cockpit.snapshot import Snapshot
from wasd_cockpit.snapshot import Stick

# A stick that is held counts for so long after the page last said so [s].
STICK_PROOF = 0.3
# More orders than these at once are nobody's wish.
MOST_ORDERS = 100


# A force in the world's axes [N].
Force = tuple[float, float, float]


class _Held(NamedTuple):
    stick: Stick | None
    force: Force | None
    at: float


class Link:
    """
    Where the page and the simulation meet, without a lock: each side swaps whole values.

    The simulation sets `snapshot`, and takes `orders`, the `stick` and the `force` of a hand; the
    page the other way round. What is held must be renewed: what nobody renews is let go.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock of wall time [s]."""
        self._clock = clock
        self._orders: deque[Order] = deque(maxlen=MOST_ORDERS)
        self._held = _Held(None, None, 0.0)
        self.snapshot: Snapshot | None = None

    def order(self, order: Order) -> None:
        """Ask for something; by the page."""
        self._orders.append(order)

    def hold(self, stick: Stick | None, force: Force | None = None) -> None:
        """Say what is held, None what is not; by the page, in each frame."""
        self._held = _Held(stick, force, self._clock())

    def take_orders(self) -> list[Order]:
        """Return what was asked for since the last call."""
        taken = []
        while self._orders:
            taken.append(self._orders.popleft())
        return taken

    @property
    def stick(self) -> Stick | None:
        """The stick as it is held now; None where nobody holds it, or says so any more."""
        return self._proved.stick

    @property
    def force(self) -> Force | None:
        """The force with which a hand pushes the robot now [N]."""
        return self._proved.force

    @property
    def _proved(self) -> _Held:
        held = self._held
        is_old = self._clock() - held.at > STICK_PROOF
        return _Held(None, None, held.at) if is_old else held
