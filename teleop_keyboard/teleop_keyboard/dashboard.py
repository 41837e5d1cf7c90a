# SPDX-License-Identifier: Apache-2.0
"""What a driver is told: the state in a line, what a key does, the lines of a dashboard."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wasd_core.timing import brief, STOP_KEY

from teleop_keyboard.keymap import (
    Direction,
    direction_words,
    factor_words,
    key_words,
    Keymap,
    SpeedFactor,
    table_lines,
)
from teleop_keyboard.keys_to_twist import KeysToTwist, Velocity

GAP = '  '


class Axis(NamedTuple):
    """Speed along or about one axis [`unit`]: commanded, measured, and what a full bar means."""

    name: str
    unit: str
    command: float
    measured: float
    full: float


class Status(NamedTuple):
    """
    What a driver wants to see of one robot.

    `state` is always shown, `message` (what to press) next, `facts` where there is room: the last
    is left out last. `axes` and `body` (height, tilt) are for a window with room for a dashboard.
    """

    state: str
    facts: tuple[str, ...] = ()
    message: str = ''
    axes: tuple[Axis, ...] = ()
    body: str = ''


def status_line(status: Status, clock: str, width: int) -> str:
    """
    Return all of it in one line no wider than `width` columns.

    State and clock are there in every width in which they fit. A message is shortened to what
    is to be done, then makes facts give way, and only then is cut, between words.
    """
    short = brief(status.message)
    fewer = [(status.facts[start:], short) for start in range(len(status.facts) + 1)]
    for facts, message in [(status.facts, status.message), *fewer]:
        line = GAP.join(filter(None, (status.state, *facts, clock, message)))
        if len(line) <= width:
            return line
    return line[: width + 1].rpartition(' ')[0].rstrip() or line[:width]


# What shows all keys; F1, too, where a layout gives `?` to a keymap.
HELP_KEY = '?'
HELP_KEYS = (HELP_KEY, 'F1')
# What a stranger tries first.
EXPECTED_TO_DRIVE = frozenset(('w', 'a', 's', 'd', 'UP', 'LEFT', 'DOWN', 'RIGHT'))
# So often it is said at length which keys drive; then the driver knows.
LESSONS = 2
_WAYS = (
    Direction(x=1.0),
    Direction(x=-1.0),
    Direction(yaw=1.0),
    Direction(yaw=-1.0),
)


def driving_keys(keymap: Keymap) -> str:
    """Return the keys for forward, back, left and right, as far as there are such."""
    keys = []
    for way in _WAYS:
        keys += [key for key, direction in keymap.motion.items() if direction == way][:1]
    return ' '.join(map(key_words, keys or list(keymap.motion)[:4]))


class KeyHints:
    """
    Tells of each press what it does where that is not seen at once.

    `help_key` shows all keys; `advice` ends a lesson; `axes` are those that the robot can move.
    It counts the lessons it gave.
    """

    def __init__(
        self,
        logic: KeysToTwist,
        help_key: str,
        *,
        advice: str = '',
        axes: tuple[str, ...] = Direction._fields,
    ) -> None:
        self._logic = logic
        self._advice = advice
        self._axes = axes
        self._help = f' ({help_key} shows the keys)'
        self._keys = driving_keys(logic.keymap)
        self._lessons = 0

    def press(self, key: str) -> str | None:
        """Return what to tell of a key that was just pressed; None where the robot answers."""
        if key == STOP_KEY:
            return 'stopped'
        keymap = self._logic.keymap
        base = key[:1] if keymap.first_character_only else key
        way = keymap.motion.get(base, Direction())
        if any(getattr(way, axis) for axis in self._axes):
            return None
        if any(way):
            return f'drive with {self._keys} ({key_words(key)} is {direction_words(way)})'
        does = self._meaning(base, key_words(key))
        if key not in EXPECTED_TO_DRIVE or base in keymap.motion or self._lessons >= LESSONS:
            return does if base in keymap.keys else does + self._help
        self._lessons += 1
        advice = f' ({self._advice})' if self._advice else self._help
        return f'drive with {self._keys}; {does}{advice}'

    def _meaning(self, key: str, name: str) -> str:
        """Return what a key does that does not drive."""
        keymap = self._logic.keymap
        if key in keymap.stop_keys:
            return f'{name} stops at once'
        if key in keymap.speed_keys:
            end = ', at its end' if self._is_at_end(keymap.speed_keys[key]) else ''
            return f'{name} is {factor_words(keymap.speed_keys[key])}{end}'
        stops = key in keymap.motion or keymap.other_keys == 'stop'
        return f'{name} {"stops" if stops else "does nothing"}'

    def _is_at_end(self, factor: SpeedFactor) -> bool:
        """Return whether a speed key has come to the end of all that it changes."""
        logic = self._logic
        keymap = logic.keymap
        values = []
        if factor.linear != 1.0:
            values.append(keymap.speed_limits.clamp(logic.speed * factor.linear) == logic.speed)
        if factor.angular != 1.0:
            values.append(keymap.turn_limits.clamp(logic.turn * factor.angular) == logic.turn)
        return bool(values) and all(values)


# Above the status line there is a dashboard in a window wider and taller than this.
NARROW, LOW = 80, 20
# A dashboard is no wider than one can look at.
WIDEST = 100
# Columns of a bar's label and of the number behind it.
LABEL_WIDTH = 18
NUMBER_WIDTH = 14
AXES = (('forward', 'm/s'), ('left', 'm/s'), ('up', 'm/s'), ('turn', 'rad/s'))
FULL, EMPTY, MIDDLE, RULE = '█', '·', '│', '─'
# The same where the terminal's encoding lacks them.
ASCII = str.maketrans({FULL: '#', EMPTY: '.', MIDDLE: '|', RULE: '-'})


class Line(NamedTuple):
    """A line of text and how it stands out: '', title, target, actual, warning or dim."""

    text: str
    style: str = ''


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What a teleoperation knows of the robot: its velocity and state, None while it is silent."""

    velocity: Velocity | None = None
    state: str | None = None
    subscribers: int = 0
    message_type: str = 'Twist'
    hint: str = ''
    shows_help: bool = False


def dashboard(logic: KeysToTwist, around: Surroundings, width: int, height: int) -> list[Line]:
    """
    Return the dashboard for a window of `width` columns and `height` lines.

    The help comes last: it is what a small window goes without, unless it was asked for.
    """
    columns = min(width - 1, WIDEST)
    lines = [*_head(logic, around, columns), *_bars(logic, around, columns)]
    lines.append(Line(RULE * columns, 'dim'))
    if around.shows_help:
        lines = [lines[0], *(Line(text) for text in table_lines(logic.keymap))]
    else:
        lines += [Line(f' {text}'.rstrip()) for text in logic.keymap.help_lines]
    if len(lines) >= height:
        lines = [line for line in lines if line.text]
    if around.shows_help and (hidden := len(lines) - (height - 1)) > 0:
        more = Line(f'{hidden + 1} more: make the window higher', 'dim')
        lines = [*lines[: max(height - 2, 0)], more]
    return [Line(line.text[:columns], line.style) for line in lines[: height - 1]]


def board(status: Status, keys: str, width: int, height: int) -> list[Line]:
    """Return the dashboard of a run, which goes above its status line; nothing without room."""
    if not status.axes or width <= NARROW or height <= LOW:
        return []
    columns = min(width, WIDEST)
    lines = [Line(RULE * columns, 'dim')]
    for axis in status.axes:
        rows = (('command', axis.command), ('measured', axis.measured))
        lines += _bar_lines(axis.name, axis.unit, axis.full, rows, columns)
    return [*lines, Line(f' body    {status.body}'), Line(f' keys    {keys}'[:columns])]


def plain_line(logic: KeysToTwist, around: Surroundings) -> str:
    """Return the same in one line, for an output that is not a terminal."""
    target = ' '.join(
        f'{AXES[axis][0]} {round(logic.target[axis], 2) + 0.0:+.2f}' for axis in logic.keymap.axes
    )
    keys = ' '.join(map(key_words, logic.motion.hold.held)) or key_words(logic.last_key) or '-'
    text = (
        f'keys {keys}  full {logic.speed:.2f} m/s {logic.turn:.2f} rad/s  '
        f'target {target}  {_connection(around).text.strip()}'
    )
    return text if around.state is None else f'{text}  robot {around.state}'


def bar(value: float, full: float, width: int) -> str:
    """
    Return a bar of `width` columns that grows from the middle; `full` fills one half.

    It draws whatever it is given: NaN is nothing, infinity is full.
    """
    half = (width - 1) // 2
    share = abs(value) / full if full > 0.0 else 0.0
    # As much as there is room for of what is infinite, nothing of what is no number.
    length = round(half * min(share, 1.0)) if share == share else 0
    if length == 0 and abs(value) > 1e-3:
        length = 1
    side = FULL * length + EMPTY * (half - length)
    blank = EMPTY * half
    return blank + MIDDLE + side if value > 0.0 else side[::-1] + MIDDLE + blank


def _head(logic: KeysToTwist, around: Surroundings, columns: int) -> list[Line]:
    keymap = logic.keymap
    title = f' wasd teleop   preset {keymap.name}   mode {logic.motion.mode}   {HELP_KEY} all keys'
    down = ' '.join(f'[{key_words(key)}]' for key in logic.motion.hold.held)
    keys = down or (f'last {key_words(logic.last_key)}' if logic.last_key else '-')
    state = around.state if around.state is not None else 'says nothing on state'
    return [
        Line(title.ljust(columns), 'title'),
        _connection(around),
        Line(f' keys    {GAP.join(filter(None, (keys, around.hint)))}'),
        Line(f' full    {logic.speed:.2f} m/s   {logic.turn:.2f} rad/s'),
        Line(f' robot   {state}'),
    ]


def _connection(around: Surroundings) -> Line:
    if around.subscribers == 0:
        return Line(' cmd_vel nobody listens yet', 'warning')
    plural = '' if around.subscribers == 1 else 's'
    count = f'{around.subscribers} subscriber{plural}'
    return Line(f' cmd_vel {count}, {around.message_type}')


def _bars(logic: KeysToTwist, around: Surroundings, columns: int) -> list[Line]:
    """Return two bars for each axis that the keymap moves: wanted and actual."""
    # Without odometry the ramp is the best that is known.
    actual = logic.velocity if around.velocity is None else around.velocity
    source = 'ramp' if around.velocity is None else 'actual'
    lines = []
    for axis in logic.keymap.axes:
        name, unit = AXES[axis]
        full = logic.turn if unit == 'rad/s' else logic.speed
        rows = (('target', logic.target[axis]), (source, actual[axis]))
        lines += _bar_lines(name, unit, full, rows, columns)
    return lines


def _bar_lines(
    name: str, unit: str, full: float, rows: Sequence[tuple[str, float]], columns: int
) -> list[Line]:
    """Return a bar for each kind of speed along one axis, the wanted one first."""
    width = max(columns - LABEL_WIDTH - NUMBER_WIDTH, 3)
    lines = []
    for row, (kind, value) in enumerate(rows):
        number = round(value, 2) + 0.0  # no -0.00
        label = '' if row else name
        text = f' {label:8}{kind:8} {bar(value, full, width)} {number:+6.2f} {unit}'
        lines.append(Line(text, 'actual' if row else 'target'))
    return lines
