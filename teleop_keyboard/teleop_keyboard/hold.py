# SPDX-License-Identifier: Apache-2.0
"""Whether a key is still down, judged from a keyboard's auto-repeat."""

from dataclasses import dataclass
from dataclasses import field

# A first press counts this long: keyboards wait up to 0.5 s before they repeat [s].
FIRST_REPEAT_TIMEOUT = 0.6
# A repeating key is released when this many gaps pass without it ...
GAPS_TO_RELEASE = 2.5
# ... but not sooner than this: one late delivery must not stop the robot [s].
SHORTEST_TIMEOUT = 0.12
# No keyboard repeats faster: presses closer than this came as one burst, e.g. from a pipe [s].
SHORTEST_GAP = 0.01
# The last gaps that are looked at; the longest counts, so jitter does not release a key.
GAPS_KEPT = 3


@dataclass
class _Key:
    """Since when a key was last seen [s] and the gaps between its last repeats [s]."""

    age: float = 0.0
    presses: int = 1
    gaps: list[float] = field(default_factory=list)

    @property
    def timeout(self) -> float:
        """How long after its last press the key still counts as held [s]."""
        if not self.gaps:
            return FIRST_REPEAT_TIMEOUT
        wanted = max(SHORTEST_TIMEOUT, GAPS_TO_RELEASE * max(self.gaps))
        return min(wanted, FIRST_REPEAT_TIMEOUT)

    def repeat(self) -> None:
        if self.age < SHORTEST_GAP:
            return
        self.presses += 1
        if self.presses == 3:
            # The gap before was the keyboard's delay before the first repeat, not its rate.
            self.gaps.clear()
        self.gaps = [*self.gaps, self.age][-GAPS_KEPT:]
        self.age = 0.0


class KeyHold:
    """
    Keeps the keys that count as held.

    Terminals tell presses, not releases. A key is held for `FIRST_REPEAT_TIMEOUT` after its first
    press; once it repeats, until the repeats fail to come. One `step` passes simulated time.
    """

    def __init__(self) -> None:
        self._keys: dict[str, _Key] = {}

    @property
    def held(self) -> tuple[str, ...]:
        """Keys that are down, in the order of their first press."""
        return tuple(self._keys)

    def press(self, key: str) -> None:
        """Note a press or a repeat of a key."""
        if key in self._keys:
            self._keys[key].repeat()
        else:
            self._keys[key] = _Key()

    def release(self, key: str) -> None:
        """Forget one key."""
        self._keys.pop(key, None)

    def clear(self) -> None:
        """Forget all keys."""
        self._keys.clear()

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass; keys that did not repeat in time are released."""
        for key, state in list(self._keys.items()):
            state.age += dt
            # The tolerance keeps sums of steps from holding a key one step too long.
            if state.age >= state.timeout - 1e-9:
                del self._keys[key]
