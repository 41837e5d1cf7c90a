# SPDX-License-Identifier: Apache-2.0
"""Selects one of several sources of velocity commands; the caller gives the time."""

from collections.abc import Sequence
import math

from wasd_core.parameters import InvalidParameter, parameter, Parameters

# The largest priority of twist_mux: no source can have more than the e-stop.
HIGHEST_PRIORITY = 255


# Nobody waits longer for a source or a lock [s].
LONGEST_TIMEOUT = 60.0


class MuxInput(Parameters):
    """
    A source of velocities, or a lock, as twist_mux's tables describe it.

    A source that is silent for `timeout` [s] is lost; 0: never. A lock that must be heard every
    `timeout` [s] locks when it is not; 0: it keeps its last word. Priorities are 0 .. 255.

    Raises:
        InvalidParameter: a field has a value that it cannot have.
    """

    name: str = parameter('', doc='')
    topic: str = parameter('', doc='')
    timeout: float = parameter(0.0, doc='', unit='s', minimum=0.0, maximum=LONGEST_TIMEOUT)
    priority: int = parameter(0, doc='', minimum=0, maximum=HIGHEST_PRIORITY)

    def __post_init__(self) -> None:
        """Check the fields."""
        try:
            super().__post_init__()
        except InvalidParameter as error:
            raise InvalidParameter(f'{self.name}.{error}') from None
        for field in ('name', 'topic'):
            if not getattr(self, field):
                raise InvalidParameter(f'{self.name}.{field} must not be empty')


# twist_mux's own tables.
DEFAULT_SOURCES = (
    MuxInput(name='navigation', topic='nav_vel', timeout=0.5, priority=10),
    MuxInput(name='keyboard', topic='key_vel', timeout=0.5, priority=90),
    MuxInput(name='joystick', topic='joy_vel', timeout=0.5, priority=100),
    MuxInput(name='tablet', topic='tab_vel', timeout=0.5, priority=100),
)
# Its locks, and an e-stop above all of them.
DEFAULT_LOCKS = (
    MuxInput(name='pause', topic='pause_navigation', timeout=0.0, priority=100),
    MuxInput(name='loop_closure', topic='stop_closing_loop', timeout=0.0, priority=200),
    MuxInput(name='joystick', topic='joy_priority', timeout=0.0, priority=100),
    MuxInput(name='e_stop', topic='e_stop', timeout=0.0, priority=HIGHEST_PRIORITY),
)


class Mux:
    """
    The choice among sources of velocities.

    It keeps when each source and each lock was heard last, and who is selected. `offer` tells of
    a message and says whether to relay it; `lock` tells a lock's state; `step` lets time come and
    says whether a zero is due: once, when the selected source was lost or locked. The highest
    priority that is alive and not below a closed lock is selected, among equals the first in the
    table; priority 0 never is. Times `now` [s] are of any one clock; when it jumps back
    everything heard before is forgotten.

    Raises:
        InvalidParameter: two inputs of a table have one name.
    """

    def __init__(
        self,
        sources: Sequence[MuxInput] = DEFAULT_SOURCES,
        locks: Sequence[MuxInput] = DEFAULT_LOCKS,
    ) -> None:
        self._sources: dict[str, MuxInput] = {}
        self._locks: dict[str, MuxInput] = {}
        self._heard: dict[str, float] = {}
        self._lock_heard: dict[str, float] = {}
        self._closed: dict[str, bool] = {}
        self.selected = ''  # the source that drives
        self._now = -math.inf
        self._zero_is_due = False
        self.configure(sources, locks)

    def configure(self, sources: Sequence[MuxInput], locks: Sequence[MuxInput]) -> None:
        """
        Replace the tables; what was heard of names that stay is kept.

        Raises:
            InvalidParameter: two inputs of a table have one name; nothing is changed then.
        """
        for table in (sources, locks):
            names = [entry.name for entry in table]
            twice = {name for name in names if names.count(name) > 1}
            if twice:
                raise InvalidParameter(f'{min(twice)} appears twice in the table')
        self._sources = {source.name: source for source in sources}
        self._locks = {lock.name: lock for lock in locks}

    def offer(self, name: str, now: float) -> bool:
        """Note a message of a source; return whether it is the one to relay."""
        self._advance(now)
        self._heard[name] = now
        self._select()
        # A message that is relayed makes a zero that was due for another source needless.
        relayed = self.selected == name
        self._zero_is_due = self._zero_is_due and not relayed
        return relayed

    def lock(self, name: str, closed: bool, now: float) -> None:
        """Note the state of a lock; `step` tells what follows from it."""
        self._advance(now)
        self._lock_heard[name] = now
        self._closed[name] = closed
        self._select()

    def step(self, now: float) -> bool:
        """Return whether a zero is to be published now, because the selected source is gone."""
        self._advance(now)
        self._select()
        due, self._zero_is_due = self._zero_is_due, False
        return due

    def _advance(self, now: float) -> None:
        if now < self._now:
            self._heard.clear()
            self._lock_heard.clear()
        self._now = now

    def _is_closed(self, lock: MuxInput, now: float) -> bool:
        heard = self._lock_heard.get(lock.name, -math.inf)
        is_silent = lock.timeout > 0.0 and now - heard > lock.timeout
        return self._closed.get(lock.name, False) or is_silent

    def _select(self) -> None:
        barrier = max(
            (lock.priority for lock in self._locks.values() if self._is_closed(lock, self._now)),
            default=0,
        )
        alive = [
            source
            for source in self._sources.values()
            if source.priority >= max(barrier, 1)
            and (heard := self._heard.get(source.name)) is not None
            and (source.timeout == 0.0 or self._now - heard <= source.timeout)
        ]
        # max() keeps the first of equals.
        chosen = max(alive, key=lambda source: source.priority).name if alive else ''
        previous, self.selected = self.selected, chosen
        overruled = previous in {source.name for source in alive}
        if previous and not overruled:
            self._zero_is_due = True
