# SPDX-License-Identifier: Apache-2.0
"""Scripted runs: velocity commands and pushes, read from text and played on simulated time."""

from collections.abc import Callable, Sequence
import math
from typing import Generic, NamedTuple, Protocol, TypeVar

from wasd_bringup.errors import UsageError

# Scripted velocity commands are repeated at this rate [Hz], as a navigation stack sends them.
TWIST_RATE = 20.0
# Simulated times [s] are compared with this slack: a sum of steps is not exact.
SLACK = 1e-9


class ScriptedTwist(NamedTuple):
    """From `time` [s] on, this velocity [m/s], [m/s], [rad/s]; None is silence."""

    time: float
    velocity: tuple[float, float, float] | None


class ScriptedPush(NamedTuple):
    """A world-frame force [N] on the trunk from `time` on for `duration` [s]."""

    time: float
    force: tuple[float, float, float]
    duration: float


class Command(NamedTuple):
    """
    What a recording says came at `time` [s] to the robot with a namespace: a key or a velocity.

    One without either is a reset of the run.
    """

    time: float
    namespace: str
    key: str | None = None
    velocity: tuple[float, float, float] | None = None


class Timed(Protocol):
    """What a player needs of an event: when it is due [s]."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""


Event = TypeVar('Event', bound=Timed)


def parse_twist_script(text: str, name: str) -> list[ScriptedTwist]:
    """
    Return the commands of a `--twist` file: lines `t vx vy wz` or `t stop`, times rising.

    NaN and infinity are let through: what a controller does with them is worth a script.

    Raises:
        UsageError: `name:line: ...` for the first line that is wrong.
    """
    commands: list[ScriptedTwist] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split('#', 1)[0].split()
        if not words:
            continue
        try:
            command = _twist_line(words)
        except ValueError:
            raise UsageError(
                f"{name}:{number}: got {line.strip()!r}, wanted 't vx vy wz' or 't stop'"
            ) from None
        if commands and command.time < commands[-1].time:
            raise UsageError(
                f'{name}:{number}: time {command.time:g} comes after {commands[-1].time:g}'
            )
        commands.append(command)
    return commands


def _twist_line(words: list[str]) -> ScriptedTwist:
    time = _seconds(words[0])
    if words[1:] == ['stop']:
        return ScriptedTwist(time, None)
    vx, vy, wz = (float(word) for word in words[1:])
    return ScriptedTwist(time, (vx, vy, wz))


def parse_push(text: str) -> ScriptedPush:
    """
    Return the push of a `--push "t fx fy fz seconds"`.

    Raises:
        UsageError: it is not five finite numbers with t and seconds >= 0.
    """
    try:
        time, fx, fy, fz, duration = text.split()
        push = ScriptedPush(_seconds(time), (float(fx), float(fy), float(fz)), _seconds(duration))
        if not all(math.isfinite(value) for value in push.force):
            raise ValueError
    except ValueError:
        raise UsageError(f"--push: got {text!r}, wanted 't fx fy fz seconds'") from None
    return push


def push_text(push: ScriptedPush) -> str:
    """Return a push as `parse_push` reads it, every digit kept."""
    return ' '.join(map(repr, (push.time, *push.force, push.duration)))


def _seconds(word: str) -> float:
    value = float(word)
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError
    return value


class Player(Generic[Event]):
    """Hands each event over once, when simulated time has reached it."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._events = sorted(events, key=lambda event: event.time)
        self._next = 0

    def due(self, time: float) -> list[Event]:
        """Return the events up to a simulated time [s] that were not returned before."""
        first = self._next
        while self._next < len(self._events) and self._events[self._next].time <= time + SLACK:
            self._next += 1
        return list(self._events[first : self._next])


class TwistPlayer:
    """Publishes scripted velocity commands; call `step` at TWIST_RATE."""

    def __init__(
        self,
        commands: Sequence[ScriptedTwist],
        publish: Callable[[tuple[float, float, float]], None],
    ) -> None:
        self._player = Player(commands)
        self._publish = publish
        self._velocity: tuple[float, float, float] | None = None

    def step(self, time: float) -> None:
        """Publish the command in force at a simulated time [s], if there is one."""
        for command in self._player.due(time):
            self._velocity = command.velocity
        if self._velocity is not None:
            self._publish(self._velocity)
