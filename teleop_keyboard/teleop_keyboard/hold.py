# SPDX-License-Identifier: Apache-2.0
"""Which keys are down, from auto-repeat or reported releases, and their direction."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
import math

from teleop_keyboard.keymap import Direction

# A first press counts this long until the keyboard's own delay is known: up to 0.5 s [s].
FIRST_REPEAT_TIMEOUT = 0.6
# With a known delay, this much more than it: a late first repeat must not stop the robot.
DELAY_FACTOR = 1.15
DELAY_MARGIN = 0.03
LONGEST_FIRST_TIMEOUT = 1.2
# What may be a delay before the first repeat at all [s].
SHORTEST_DELAY = 0.15
# Repeats come no slower than this, and evenly [s]; fingers do not.
LONGEST_GAP = 0.11
EVEN_GAPS = 1.6
# A repeating key is released when this many gaps pass without it ...
GAPS_TO_RELEASE = 2.5
# ... but not sooner than this: one late delivery must not stop the robot [s].
SHORTEST_TIMEOUT = 0.12
# No keyboard repeats faster: presses closer than this came as one burst, e.g. from a pipe [s].
SHORTEST_GAP = 0.01
# The last gaps that are looked at; the longest counts, so jitter does not release a key.
GAPS_KEPT = 3
# Keys pressed within this time are one chord: only the last one repeats, but all are down [s].
CHORD_WINDOW = 0.08
# Sums of steps must not hold a key one step too long [s].
ROUNDING = 1e-9
# A key whose release will be told is given up when nothing is heard of it for so long [s].
HELD_TIMEOUT = 0.35


@dataclass
class _Key:
    """Since when a key was last seen [s], and what its timing says about it."""

    first_timeout: float
    age: float = 0.0
    presses: int = 1
    gaps: list[float] = field(default_factory=list)
    is_down: bool = True
    # Whether its release will be told.
    is_told: bool = False
    # The key that stands for it: the last one of a chord.
    leader: str = ''
    # Whether another key has been pressed since: it will not repeat any more.
    is_overtaken: bool = False

    @property
    def timeout(self) -> float:
        """How long after its last press the key still counts as held [s]."""
        if self.is_told:
            return HELD_TIMEOUT
        # The gap after the first press is the keyboard's delay, not its rate.
        gaps = self.gaps[1:] if len(self.gaps) > 1 else self.gaps
        if not gaps:
            return SHORTEST_TIMEOUT if self.is_overtaken else self.first_timeout
        wanted = max(SHORTEST_TIMEOUT, GAPS_TO_RELEASE * max(gaps[-GAPS_KEPT:]))
        return min(wanted, self.first_timeout)


class KeyHold:
    """
    Keeps the keys that count as held.

    Terminals mostly tell presses, not releases. A key is held after its first press for as long
    as the keyboard takes to repeat it, which is learnt from it; once it repeats, until the repeats
    fail to come. Only the last key pressed repeats, so an earlier one ends soon after, unless both
    were pressed together. Where a terminal tells releases (`keep_down`, `release`), these count.
    In any case a key ends when nothing was heard of it for `longest` [s]. One `step` passes
    simulated time.

    After a stop, keys whose release will be told do not count until then (`ignore_down`): a
    finger that rests on one is no wish to go on.
    """

    def __init__(self) -> None:
        self.longest = math.inf
        self._keys: dict[str, _Key] = {}
        self._ignored: dict[str, float] = {}  # since when nothing was heard of each [s]
        self.first_timeout = FIRST_REPEAT_TIMEOUT  # how long a first press counts [s]

    @property
    def held(self) -> tuple[str, ...]:
        """Keys that are down, in the order of their first press."""
        return tuple(name for name, key in self._keys.items() if key.is_down)

    @property
    def is_idle(self) -> bool:
        """Whether no key is remembered, so that time makes no difference."""
        return not (self._keys or self._ignored)

    def press(self, name: str) -> None:
        """Note a press or a repeat of a key."""
        key = self._keys.get(name)
        if key is not None and key.age < SHORTEST_GAP:
            return
        # One that was given up too soon comes back: a delay longer than was thought.
        if key is not None and (key.is_down or (key.presses == 1 and not key.is_overtaken)):
            self._repeat(key)
            return
        chord = [other for other, state in self._keys.items() if self._joins_chord(state)]
        for other, state in self._keys.items():
            state.is_overtaken = True
            state.leader = name if other in chord else ''
        self._keys.pop(name, None)
        self._keys[name] = _Key(self.first_timeout)

    def ignore_down(self) -> None:
        """Forget all keys; those that are down count again when they were let go."""
        told = (name for name, key in self._keys.items() if key.is_told and key.is_down)
        self._ignored |= dict.fromkeys(told, 0.0)
        self._keys.clear()

    def hear_ignored(self, name: str) -> bool:
        """Return whether a key has been down since a stop, and note that it was heard."""
        if name in self._ignored:
            self._ignored[name] = 0.0
        return name in self._ignored

    def keep_down(self, name: str) -> None:
        """Note that a key is down, and that its release will be told."""
        if self.hear_ignored(name):
            return
        key = self._keys.setdefault(name, _Key(self.first_timeout))
        key.is_told = key.is_down = True
        key.age = 0.0

    def release(self, name: str) -> None:
        """Forget one key."""
        self._keys.pop(name, None)
        self._ignored.pop(name, None)

    def clear(self) -> None:
        """Forget all keys."""
        self._keys.clear()

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass; keys that did not repeat in time are released."""
        heard = {name: age + dt for name, age in self._ignored.items()}
        # Its release may have been lost.
        self._ignored = {name: age for name, age in heard.items() if age < HELD_TIMEOUT}
        for name, key in list(self._keys.items()):
            key.age += dt
            is_over = key.age >= key.timeout - ROUNDING and not self._is_led(key)
            if is_over or key.age >= self.longest - ROUNDING:
                key.is_down = False
            if key.age >= LONGEST_FIRST_TIMEOUT and not key.is_down:
                del self._keys[name]

    def _repeat(self, key: _Key) -> None:
        key.presses += 1
        key.gaps = [*key.gaps, key.age][-GAPS_KEPT - 1 :]
        key.age = 0.0
        key.is_down = True
        key.is_overtaken = False
        self._learn(key)

    def _learn(self, key: _Key) -> None:
        """Take the keyboard's delay from a gap that two quick, even ones follow."""
        if len(key.gaps) < 3:
            return
        delay, first, second = key.gaps[-3:]
        is_even = max(first, second) <= EVEN_GAPS * min(first, second)
        if is_even and max(first, second) <= LONGEST_GAP and delay >= SHORTEST_DELAY:
            wanted = DELAY_FACTOR * delay + DELAY_MARGIN
            self.first_timeout = min(wanted, LONGEST_FIRST_TIMEOUT)

    def _joins_chord(self, key: _Key) -> bool:
        return key.is_down and key.presses == 1 and key.age <= CHORD_WINDOW and not key.is_told

    def _is_led(self, key: _Key) -> bool:
        leader = self._keys.get(key.leader)
        return leader is not None and leader.is_down and not key.is_told


NOWHERE = Direction()


def combine(directions: Iterable[Direction]) -> Direction:
    """
    Return the sum of directions within full speed.

    Opposites cancel; a diagonal is no faster than straight on: (forward, left, up) has at most
    length 1. Turning has its own limit.
    """
    sums = map(sum, zip(NOWHERE, *directions, strict=True))
    x, y, z, yaw = (min(max(value, -1.0), 1.0) for value in sums)
    length = max(math.hypot(x, y, z), 1.0)
    return Direction(x / length, y / length, z / length, yaw)


class Motion:
    """
    The direction of the motion keys, in one of three modes.

    `hold`: all keys that are down count together. `latch`: the last key counts until the next.
    `step`: each press adds a share of full speed, up to all of it. In the latter two a direction
    ends when no motion key was heard of for `hold.longest` [s]. `step` lets time pass.
    """

    def __init__(self, keys: Mapping[str, Direction], mode: str, share: float) -> None:
        self._keys = keys
        self.hold = KeyHold()
        self._latched = NOWHERE
        self._silence = 0.0
        self.mode = mode
        self.share = share

    @property
    def direction(self) -> Direction:
        """Shares of full speed and turn."""
        if self.mode == 'hold':
            return combine(self._keys[key] for key in self.hold.held)
        return self._latched

    def press(self, key: str) -> None:
        """Take a press or a repeat of a motion key."""
        if self.hold.hear_ignored(key):
            return
        self.hold.press(key)
        self._silence = 0.0
        asked = self._keys[key]
        if self.mode == 'latch':
            self._latched = combine([asked])
        elif self.mode == 'step':
            if asked == NOWHERE:
                self._latched = NOWHERE
                return
            values = zip(self._latched, asked, strict=True)
            self._latched = combine([Direction(*(v + self.share * a for v, a in values))])

    def keep_down(self, key: str) -> None:
        """Note that a motion key is down and that its release will be told."""
        if key in self._keys:
            self.hold.keep_down(key)
            self._silence = 0.0

    def release(self, key: str) -> None:
        """Note that a key was released."""
        self.hold.release(key)

    def forget(self) -> None:
        """Ask for standing still."""
        self.hold.clear()
        self._latched = NOWHERE

    def stop(self) -> None:
        """Ask for standing still, also while keys are down: they count when pressed again."""
        self.hold.ignore_down()
        self._latched = NOWHERE

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self.hold.step(dt)
        self._silence += dt
        if self._silence >= self.hold.longest - ROUNDING:
            self._latched = NOWHERE
