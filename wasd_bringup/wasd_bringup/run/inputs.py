# SPDX-License-Identifier: Apache-2.0
"""What comes into a run: scripts, keys of its own, when messages are due."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
import math
from operator import attrgetter
from typing import Any, NamedTuple

from mujoco_sim.parameters import BoxSize
from teleop_keyboard.dashboard import HELP_KEY
from wasd_core.errors import UserError

# Simulated times [s] are compared with this slack: a sum of steps is not exact.
SLACK = 1e-9


class ScriptedTwist(NamedTuple):
    """From `time` [s] on, this velocity [m/s], [m/s], [rad/s]; None is silence."""

    time: float
    velocity: tuple[float, float, float] | None


class ScriptedPush(NamedTuple):
    """
    A world-frame force [N] on the trunk from `time` on for `duration` [s].

    It acts at a point of the base's frame [m], or else at the centre of mass.
    """

    time: float
    force: tuple[float, float, float]
    duration: float
    point: tuple[float, ...] | None = None


class ScriptedBox(NamedTuple):
    """From `time` [s] on a box stands there, in the world's axes [m], [rad], of such a size."""

    time: float
    x: float
    y: float
    yaw: float
    size: BoxSize


class Command(NamedTuple):
    """
    What a recording says came at `time` [s] to the robot with a namespace: a key or a velocity.

    A velocity was `age` [s] old by its stamp.
    Or an `event` of the whole run: 'reset', 'step' by hand, or 'e-stop', whose keys come after it.
    """

    time: float
    namespace: str
    key: str | None = None
    velocity: tuple[float, float, float] | None = None
    age: float = 0.0
    event: str = ''


# Where to drive in the map: x, y [m] and yaw [rad], NaN for that of the way there.
Goal = tuple[float, float, float]


def parse_twist_script(text: str, name: str) -> list[ScriptedTwist]:
    """
    Return the commands of a `--twist` file: lines `t vx vy wz` or `t stop`, times rising.

    NaN and infinity are let through: what a controller does with them is worth a script.

    Raises:
        UserError: `name:line: ...` for the first line that is wrong.
    """
    commands: list[ScriptedTwist] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split('#', 1)[0].split()
        if not words:
            continue
        try:
            time = _seconds(words[0])
            velocity = None
            if words[1:] != ['stop']:
                vx, vy, wz = map(float, words[1:])
                velocity = vx, vy, wz
            command = ScriptedTwist(time, velocity)
        except ValueError:
            raise UserError(
                f"{name}:{number}: got {line.strip()!r}, wanted 't vx vy wz' or 't stop'"
            ) from None
        if commands and command.time < commands[-1].time:
            raise UserError(
                f'{name}:{number}: time {command.time:g} comes after {commands[-1].time:g}'
            )
        commands.append(command)
    return commands


def parse_push(text: str) -> ScriptedPush:
    """
    Return the push of a `--push "t fx fy fz seconds [x y z]"`.

    Raises:
        UserError: it is not five or eight finite numbers with t and seconds >= 0.
    """
    try:
        words = text.split()
        _, fx, fy, fz, _, *point = numbers = [float(word) for word in words]
        if not (all(map(math.isfinite, numbers)) and len(point) in (0, 3)):
            raise ValueError
        start, duration = _seconds(words[0]), _seconds(words[4])
        return ScriptedPush(start, (fx, fy, fz), duration, tuple(point) or None)
    except ValueError:
        wanted = "'t fx fy fz seconds [x y z]', t and seconds >= 0"
        raise UserError(f'--push: got {text!r}, wanted {wanted}') from None


def parse_box(text: str) -> ScriptedBox:
    """
    Return the box of a `--box "t x y [yaw [length width]]"`.

    Raises:
        UserError: it is not three, four or six finite numbers with t >= 0 and a size > 0.
    """
    try:
        words = text.split()
        x, y, *more = [float(word) for word in words[1:]]
        yaw, *size = more or [0.0]
        if not (all(map(math.isfinite, (x, y, yaw, *size))) and min(size, default=1.0) > 0.0):
            raise ValueError
        length, width = size or BoxSize()[:2]
        return ScriptedBox(_seconds(words[0]), x, y, yaw, BoxSize(length, width))
    except (ValueError, IndexError):
        wanted = "'t x y [yaw [length width]]', t >= 0 and a size > 0"
        raise UserError(f'--box: got {text!r}, wanted {wanted}') from None


def box_text(box: ScriptedBox) -> str:
    """Return a box as `parse_box` reads it, every digit kept."""
    return ' '.join(map(repr, (box.time, box.x, box.y, box.yaw, *box.size[:2])))


def push_text(push: ScriptedPush) -> str:
    """Return a push as `parse_push` reads it, every digit kept."""
    return ' '.join(map(repr, (push.time, *push.force, push.duration, *(push.point or ()))))


# No number of a goal is larger [m], [rad].
FARTHEST = 1e6


def parse_goal(text: str) -> Goal:
    """
    Return the goal of a `--goal "X Y [YAW]"` [m], [rad]; without a yaw it is NaN.

    Raises:
        UserError: it is not two or three numbers of at most FARTHEST.
    """
    try:
        numbers = [float(word) for word in text.split()]
        if len(numbers) not in (2, 3) or not all(abs(number) <= FARTHEST for number in numbers):
            raise ValueError
    except ValueError:
        wanted = f"'X Y' or 'X Y YAW' [m, rad], each within {FARTHEST:g}"
        raise UserError(f'--goal: got {text!r}, wanted {wanted}') from None
    x, y, yaw = numbers if len(numbers) == 3 else (*numbers, math.nan)
    return x, y, yaw


def _seconds(word: str) -> float:
    value = float(word)
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError
    return value


class Player:
    """Hands each event over once, when simulated time has reached its `time` [s]."""

    def __init__(self, events: Sequence[Any]) -> None:
        self._events = sorted(events, key=attrgetter('time'))
        self._next = 0
        # The simulated time of the next event [s]; infinity after the last.
        self.next_time = -math.inf

    def due(self, time: float) -> list[Any]:
        """Return the events up to a simulated time [s] that were not returned before."""
        if time < self.next_time:
            return []  # in almost every instant
        events, first = self._events, self._next
        self._next = end = bisect_right(events, time + SLACK, first, key=attrgetter('time'))
        self.next_time = events[end].time - SLACK if end < len(events) else math.inf
        return events[first:end]


class BoxPlayer(Player):
    """Puts scripted boxes, whose numbers are those of their order, where they are to stand."""

    def __init__(
        self,
        boxes: Sequence[ScriptedBox],
        put: Callable[[int, float, float, float], bool],
    ) -> None:
        super().__init__(boxes)
        self._boxes, self._put = boxes, put

    def step(self, time: float) -> list[ScriptedBox]:
        """Put those that are due at a simulated time [s]; return the ones that have no place."""
        return [
            box
            for box in self.due(time)
            if not self._put(self._boxes.index(box), box.x, box.y, box.yaw)
        ]


class TwistPlayer:
    """Publishes scripted velocity commands; call `step` at TWIST_RATE."""

    def __init__(
        self,
        commands: Sequence[ScriptedTwist],
        publish: Callable[[tuple[float, float, float]], object],
    ) -> None:
        self._player = Player(commands)
        self._publish = publish
        self._velocity: tuple[float, float, float] | None = None

    def end(self) -> None:
        """Command nothing more."""
        self._player, self._velocity = Player([]), None

    def step(self, time: float) -> None:
        """Publish the command in force at a simulated time [s], if there is one."""
        for command in self._player.due(time):
            self._velocity = command.velocity
        if self._velocity is not None:
            self._publish(self._velocity)


# MuJoCo's own viewer has it there; no preset on any layout uses it.
RESET_KEY = 'BACKSPACE'
# Stops every robot for good; with --latched nothing drives before the other one.
E_STOP_KEY, END_E_STOP_KEY = 'ESC', 'ENTER'
SWITCH_KEY = 'TAB'
SWITCH_LINE = f'{SWITCH_KEY} goes to the next robot'
KEY_LINE = (
    f'{HELP_KEY} all keys   {RESET_KEY} back to the start   {E_STOP_KEY} E-STOP   Ctrl-C quit'
)


# Messages and services are looked after so often [s of wall time], but for no more than this
# share of it: a look at two dozen subscriptions takes milliseconds, on a busy machine many ...
PERIOD = 0.02
SHARE = 0.1
# ... unless simulated time has gone on by so much: time-outs are in it, the shortest 0.5 s [s].
LONGEST_PAUSE = 0.15


class MessageTimes:
    """
    Says when the next look at messages is due, by what the last one took.

    If looks are slow, physics waits: a sender of 20 Hz must not seem silent. It reads no clock.
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
