# SPDX-License-Identifier: Apache-2.0
"""What a driver sees of a teleoperation: the lines of a dashboard, and of a log without one."""

from dataclasses import dataclass
from typing import NamedTuple

from teleop_keyboard.key_hints import HELP_KEY
from teleop_keyboard.keymap_text import key_words
from teleop_keyboard.keymap_text import table_lines
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.ramp import Velocity
from teleop_keyboard.status_text import GAP

# A dashboard is no wider than one can look at.
WIDEST = 100
# Columns of a bar's label and of the number behind it.
LABEL_WIDTH = 17
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
    return [Line(line.text[:columns], line.style) for line in lines[: height - 1]]


def plain_line(logic: KeysToTwist, around: Surroundings) -> str:
    """Return the same in one line, for an output that is not a terminal."""
    target = ' '.join(
        f'{AXES[axis][0]} {round(logic.target[axis], 2) + 0.0:+.2f}' for axis in logic.keymap.axes
    )
    keys = ' '.join(map(key_words, logic.keys_down)) or key_words(logic.last_key) or '-'
    text = (
        f'keys {keys}  full {logic.speed:.2f} m/s {logic.turn:.2f} rad/s  '
        f'target {target}  {_connection(around).text.strip()}'
    )
    return text if around.state is None else f'{text}  robot {around.state}'


def bar(value: float, full: float, width: int) -> str:
    """Return a bar of `width` columns that grows from the middle; `full` fills one half."""
    half = (width - 1) // 2
    length = min(round(half * abs(value) / full), half) if full > 0.0 else 0
    if length == 0 and abs(value) > 1e-3:
        length = 1
    side = FULL * length + EMPTY * (half - length)
    blank = EMPTY * half
    return blank + MIDDLE + side if value > 0.0 else side[::-1] + MIDDLE + blank


def _head(logic: KeysToTwist, around: Surroundings, columns: int) -> list[Line]:
    keymap = logic.keymap
    title = f' wasd teleop   preset {keymap.name}   mode {logic.mode}   {HELP_KEY} all keys'
    down = ' '.join(f'[{key_words(key)}]' for key in logic.keys_down)
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
    width = max(columns - LABEL_WIDTH - NUMBER_WIDTH, 3)
    lines = []
    for axis in logic.keymap.axes:
        name, unit = AXES[axis]
        full = logic.turn if unit == 'rad/s' else logic.speed
        rows = ((name, 'target', logic.target[axis]), ('', source, actual[axis]))
        for label, kind, value in rows:
            number = round(value, 2) + 0.0  # no -0.00
            text = f' {label:8}{kind:7} {bar(value, full, width)} {number:+6.2f} {unit}'
            lines.append(Line(text, 'target' if kind == 'target' else 'actual'))
    return lines
