# SPDX-License-Identifier: Apache-2.0
"""Which source drives a robot, since when, and by which right."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
import math
from typing import NamedTuple, Protocol

from teleop_keyboard.hold import LONGEST_FIRST_TIMEOUT
from wasd_core.timing import HELD, RELEASE, split_event

# A key or a velocity counts as released after a silence longer than the slowest keyboard's before
# its first repeat [s].
SILENCE = LONGEST_FIRST_TIMEOUT
# `DriverState.asks` names the sources that asked within this time and do not drive [s].
ASKED_LATELY = 1.0
# The source that holds a latched stop; it drives nothing, and nobody takes over from it.
E_STOP = 'e-stop'
# Presses the stop key in the name of a source that is gone.
LOST = 'lost'
# What a source may do by its right: all that are not here command as a program does.
RIGHTS = {
    E_STOP: 'stop',
    LOST: 'stop',
    'keys': 'hand',
    'page': 'hand',
    'gamepad': 'hand',
    'navigator': 'plan',
}
USUAL_RIGHT = 'program'
SCRIPTS = ('script', 'recording')
# Sources that act in simulated time; all others act in wall time, as hands do.
SIMULATED = (*SCRIPTS, 'navigator')

Velocity = tuple[float, float, float]


def right_of(source: str) -> str:
    """Return the right of a source; `foxglove 3` is of the kind `foxglove`."""
    return RIGHTS.get(source.partition(' ')[0], USUAL_RIGHT)


class Held(NamedTuple):
    """What a released source was moving: by keys, by a velocity."""

    keys: bool
    velocity: bool


class DriverState(NamedTuple):
    """
    Who drives ('' for nobody), since when [s], by which right; who asks; who stopped it.

    `stopped_by` is the source of a stop that holds, `last_stop_by` that of the last stop, until
    somebody drives. `guard` is what a guard does to the command: '' for nothing, `approach`, ...
    """

    driver: str = ''
    since: float = 0.0
    right: str = ''
    asks: tuple[str, ...] = ()
    stopped_by: str = ''
    guard: str = ''
    last_stop_by: str = ''


@dataclass
class _Hold:
    """What one source holds, and which part is ignored until its release."""

    down: set[str] = field(default_factory=set)
    is_latched: bool = False
    is_driving: bool = False
    ages: dict[str, float] = field(default_factory=dict)  # since the last press of a key [s]
    refused_keys: set[str] = field(default_factory=set)
    is_refused: bool = False  # its velocity
    asked: float = math.inf  # so long ago [s]

    @property
    def held(self) -> Held:
        """What moves the robot now: a pressed or latched key, a velocity."""
        return Held(bool(self.down) or self.is_latched, self.is_driving)

    @property
    def drives(self) -> bool:
        """Whether it moves the robot, or may press a key without releases again."""
        return any(self.held) or bool(self.ages)

    def let_go(self) -> None:
        """Release everything."""
        self.down.clear()
        self.is_latched = self.is_driving = False


class Drivers:
    """
    The sources of one robot: keys, page, gamepad, script, topic, navigator, programs.

    `take` asks whether a key or a velocity of a source counts, `release` releases a source, `stop`
    stops the motion of all sources, `disarm` ignores what they hold until it is released and
    pressed again. The latest source to take the robot drives. This class reads no clock and moves
    nothing: its callers act on its answers.

    `stops(key)` is whether a press ends every motion by keys, `latches(key)` whether the motion
    continues after the key's release. With `holds_stops` a stop lasts until the release of E_STOP.
    """

    def __init__(
        self,
        stops: Callable[[str], bool],
        latches: Callable[[str], bool],
        holds_stops: bool = False,
    ) -> None:
        self._stops, self._latches = stops, latches
        self._holds_stops = holds_stops
        self._holds: dict[str, _Hold] = {}
        self._driver, self._since = '', 0.0
        self.stopped_by = ''  # the source of a stop that holds
        self.last_stop_by = ''  # that of the last stop, until somebody drives
        # What a guard does to the command.
        self.guard: Callable[[], str] = lambda: ''
        self.time = 0.0  # simulated [s], told by who steps the run
        # Told of a source and its means (`a key`, `a velocity`), at each take, before it drives:
        # what drives by itself gives way.
        self.on_take: list[Callable[[str, str], None]] = []

    @property
    def state(self) -> DriverState:
        """Who drives now, and who asks."""
        state = DriverState(asks=self._asking(), last_stop_by=self.last_stop_by)
        if self.stopped_by:
            state = state._replace(stopped_by=self.stopped_by)
            return state._replace(driver=E_STOP, since=self._since, right=right_of(E_STOP))
        state = state._replace(guard=self.guard())
        hold = self._holds.get(self._driver)
        if hold is None or not hold.drives:
            return state
        right = right_of(self._driver)
        return state._replace(driver=self._driver, since=self._since, right=right)

    def held(self, source: str) -> Held:
        """Return what of a source moves the robot: pressed or latched keys, a velocity."""
        return self._holds.get(source, _Hold()).held

    def take(
        self,
        source: str,
        *,
        key: str | None = None,
        velocity: Iterable[float] = (),
        what: str = '',
    ) -> bool:
        """
        Return whether a key or a velocity [m/s], [m/s], [rad/s] of a source counts now.

        A key without a name never counts. `what` is how a source that gives way names this one.
        """
        if key == '':
            return False
        begins = self._driver != source or not self.state.driver
        hold = self._holds.setdefault(source, _Hold())
        hold.asked = 0.0
        counts = self._take_key(hold, key) if key else self._take_velocity(hold, velocity)
        if not counts or (self.stopped_by and source != E_STOP):
            return False
        if key and split_event(key)[0] == RELEASE:
            return True  # it gives up, and takes nothing
        for tell in self.on_take:
            tell(source, what or ('a key' if key else 'a velocity'))
        if begins:
            self._driver, self._since = source, self.time
        if hold.drives and right_of(source) != 'stop':
            self.last_stop_by = ''
        return True

    def release(self, source: str) -> Held:
        """Release a source; return what it moved until now."""
        if source == E_STOP:
            self.stopped_by = ''
            self.disarm()  # what was pressed meanwhile does not count either
        return self._holds.pop(source, _Hold()).held

    def stop(self, by: str) -> None:
        """Stop the robot for a source; a latched stop holds until its release."""
        self.disarm()
        self.last_stop_by = by
        if self._holds_stops and not self.stopped_by:
            self.stopped_by, self._since = by, self.time

    def disarm(self, source: str = '') -> Held:
        """
        Ignore what a source, or every source, holds now until it is released and pressed again.

        Return what moved the robot until now.
        """
        holds = [hold for name, hold in self._holds.items() if source in ('', name)]
        held = [hold.held for hold in holds]
        for hold in holds:
            hold.refused_keys |= hold.down | set(hold.ages)
            hold.is_refused |= hold.is_driving
            hold.let_go()
        return Held(any(each.keys for each in held), any(each.velocity for each in held))

    def reset(self) -> None:
        """Note that the robot stands; ignored keys and velocities stay ignored."""
        for hold in self._holds.values():
            hold.let_go()

    def step(self, dt: float, haste: float = 1.0) -> None:
        """
        Let `dt` [s] of simulated time pass: release what is no longer repeated.

        Simulated time runs `haste` times as fast as wall time.
        """
        for source, hold in self._holds.items():
            passed = dt if source in SIMULATED else dt / haste
            hold.asked += passed
            if hold.asked > SILENCE:
                hold.is_driving = hold.is_refused = False
            for key in hold.ages:
                hold.ages[key] += passed
            for key in [key for key, age in hold.ages.items() if age > SILENCE]:
                del hold.ages[key]
                if key not in hold.down:
                    hold.refused_keys.discard(key)

    def _take_key(self, hold: _Hold, name: str) -> bool:
        event, key = split_event(name)
        if event == RELEASE:
            hold.down.discard(key)
            hold.ages.pop(key, None)
            hold.refused_keys.discard(key)
            return True
        hold.ages[key] = 0.0
        if key in hold.refused_keys and not self._stops(key):
            return False
        if event == HELD:
            hold.down.add(key)
        elif self._stops(key):
            for each in self._holds.values():
                each.is_latched = False
        elif self._latches(key):
            hold.is_latched = True
        return True

    def _take_velocity(self, hold: _Hold, velocity: Iterable[float]) -> bool:
        is_moving = any(velocity)
        if not is_moving:
            hold.is_refused = False
        if hold.is_refused:
            return False
        hold.is_driving = is_moving
        return True

    def _asking(self) -> tuple[str, ...]:
        """Return the sources that asked recently and do not drive."""
        driver = '' if self.stopped_by else self._driver
        return tuple(
            name
            for name, hold in self._holds.items()
            if hold.asked < ASKED_LATELY and name != driver
        )


class Driver(Protocol):
    """A driver of a robot; a Run calls it after `join`."""

    @property
    def first_line(self) -> str:
        """The first line for the user."""

    def look(self) -> None:
        """Read new input; called often, on wall time."""

    def repeat(self) -> None:
        """Command the present velocity again; called at TWIST_RATE of simulated time."""

    def disarm(self) -> None:
        """Ignore what is held now."""

    def close(self) -> None:
        """End."""
