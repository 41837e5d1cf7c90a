# SPDX-License-Identifier: Apache-2.0
"""
Names of keys in messages, keymaps, scripts and on other layouts, and their meaning.

A printable character is called by itself (`w`, `é`, and a blank for the space bar). Other keys
have names in capitals (`UP`, `F5`, `ESC`). Modifiers stand in front, in the order CTRL, ALT,
SHIFT: `CTRL+A`, `ALT+x`, `CTRL+SHIFT+UP`. Shift is not named where it only picks the character.

A name stands for a press; what else is told of keys is in `wasd_core.timing`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import itertools
import math
import signal
from typing import NamedTuple

from wasd_core.errors import did_you_mean
from wasd_core.parameters import InvalidParameter
from wasd_core.timing import ALIASES, split_event, STOP_KEY, with_event

MODIFIERS = ('CTRL', 'ALT', 'SHIFT')
FUNCTION_KEYS = tuple(f'F{number}' for number in range(1, 13))
NAMED_KEYS = frozenset(
    ('UP', 'DOWN', 'LEFT', 'RIGHT', 'HOME', 'END', 'PGUP', 'PGDN', 'INSERT', 'DELETE')
    + ('ESC', 'ENTER', 'TAB', 'BACKSPACE', STOP_KEY)
    + FUNCTION_KEYS
)

# Keys that a terminal makes a signal of; from one that reports them as sequences, we do.
SIGNAL_KEYS = {
    'CTRL+C': signal.SIGINT,
    'CTRL+Z': signal.SIGTSTP,
    'CTRL+\\': signal.SIGQUIT,
}


def capital(character: str) -> str:
    """Return the capital of a character; itself where that would be several, as of `ß`."""
    upper = character.upper()
    return upper if len(upper) == 1 else character


def with_modifiers(key: str, *, ctrl: bool = False, alt: bool = False, shift: bool = False) -> str:
    """Return the name of a key pressed together with modifiers; blanks become `SPACE`."""
    if not (ctrl or alt or shift):
        return key
    base = 'SPACE' if key == ' ' else key
    if ctrl and len(base) == 1:
        # Terminals cannot tell Ctrl+a from Ctrl+A: one name for both.
        base = capital(base)
    pressed = zip(MODIFIERS, (ctrl, alt, shift), strict=True)
    return '+'.join([name for name, is_down in pressed if is_down] + [base])


def canonical_key(text: str) -> str:
    """
    Return the key that a name in a file means, as it stands in messages.

    Raises:
        ValueError: when `text` is neither one printable character nor the name of a key.
    """
    event, rest = split_event(text)
    if event:
        return with_event(event, canonical_key(rest))
    modifiers, base = _split(text)
    if base in ALIASES:
        base = ALIASES[base]
    elif base not in NAMED_KEYS and not (len(base) == 1 and base.isprintable()):
        hint = did_you_mean(base.upper(), (*NAMED_KEYS, *ALIASES))
        raise ValueError(f'unknown key {text!r}{hint} (a key is one character or a name like UP)')
    return with_modifiers(base, **{name.lower(): True for name in modifiers})


def _split(text: str) -> tuple[list[str], str]:
    """Return the modifiers in front of a key, and the key."""
    modifiers = []
    while len(text) > 1 and '+' in text[1:]:
        head, rest = text.split('+', 1)
        if head not in MODIFIERS or head in modifiers or not rest:
            break
        modifiers.append(head)
        text = rest
    return modifiers, text


LAYOUTS = ('qwerty', 'azerty', 'dvorak')

# The same places, row by row, and again with Shift; digits and others are where qwerty has them.
_PLACES = {
    'qwerty': ("qwertyuiop[]asdfghjkl;'zxcvbnm,./-=", 'QWERTYUIOP{}ASDFGHJKL:"ZXCVBNM<>?_+'),
    # Without the keys of its digits' row, which Shift makes digits.
    'azerty': ('azertyuiop^$qsdfghjklmùwxcvbn,;:!)=', 'AZERTYUIOP¨£QSDFGHJKLM%WXCVBN?./§°+'),
    'dvorak': ("',.pyfgcrl/=aoeuidhtns-;qjkxbmwvz[]", '"<>PYFGCRL?+AOEUIDHTNS_:QJKXBMWVZ{}'),
}


def places(layout: str) -> Mapping[str, str]:
    """Return what the keys of qwerty are called on a layout, without and with Shift."""
    return dict(zip(''.join(_PLACES['qwerty']), ''.join(_PLACES[layout]), strict=True))


def on_layout(key: str, layout: str) -> str:
    """Return the name that a key of qwerty has on a layout; modifiers stay."""
    return _renamed(key, places(layout))


def on_qwerty(key: str, layout: str) -> str:
    """Return what the key that a layout calls `key` is called on qwerty; modifiers stay."""
    return _renamed(key, {name: place for place, name in places(layout).items()})


def _renamed(key: str, names: Mapping[str, str]) -> str:
    head, plus, base = key.rpartition('+')
    if plus and base and all(word in MODIFIERS for word in head.split('+')):
        return f'{head}+{names.get(base, base)}'
    return names.get(key, key)


MODES = ('hold', 'latch', 'step')
OTHER_KEYS = ('stop', 'ignore')
IDLE_POLICIES = ('silent', 'zeros', 'repeat')
# What keymaps and parameters may ask for: [Hz], [m/s] or [rad/s], [m/s^2] or [rad/s^2].
HIGHEST_RATE, HIGHEST_SPEED, HIGHEST_ACCEL = 500.0, 100.0, 1000.0
# Less is none: a robot would not start, or not stop.
LOWEST_RATE, LOWEST_ACCEL = 1.0, 0.05


class KeymapError(InvalidParameter):
    """A keymap cannot be used; gives file, line, key, the value and what is wanted."""


class Direction(NamedTuple):
    """Shares of full speed and turn, in [-1, 1]: forward, to the left, up, counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


class SpeedFactor(NamedTuple):
    """The factors of a speed key for speed and turn."""

    linear: float
    angular: float


class Limits(NamedTuple):
    """The smallest and the largest value that may be set."""

    low: float
    high: float

    def clamp(self, value: float) -> float:
        """Return the legal value nearest to `value`."""
        return min(max(value, self.low), self.high)


@dataclass(frozen=True, kw_only=True)
class Keymap:
    """
    A table of keys and the defaults that go with it.

    In mode `hold` motion keys count while they are down, in mode `latch` one counts until the
    next, in mode `step` each press adds to what there is.
    `other_keys` says whether a key that means nothing stops the robot (on the ramp).
    With `first_character_only` just the first character of a message counts.
    `idle` says what is published while the robot stands: `silent`, one zero, then nothing;
    `zeros`, zeros at the rate once a key was pressed; `repeat`, the last command, from the start.
    """

    name: str
    motion: Mapping[str, Direction]
    speed_keys: Mapping[str, SpeedFactor]
    stop_keys: frozenset[str]
    help_lines: tuple[str, ...]
    mode: str
    other_keys: str
    first_character_only: bool
    idle: str
    rate: float  # [Hz]
    speed: float  # [m/s]
    turn: float  # [rad/s]
    speed_limits: Limits  # [m/s]
    turn_limits: Limits  # [rad/s]
    linear_accel: float  # [m/s^2]
    angular_accel: float  # [rad/s^2]

    @property
    def axes(self) -> tuple[int, ...]:
        """Indices into a direction of the axes that some key moves."""
        columns = zip(*self.motion.values(), strict=True)
        return tuple(axis for axis, shares in enumerate(columns) if any(shares))

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that mean something."""
        return *self.motion, *self.speed_keys, *sorted(self.stop_keys)


# Lines fit an 80-column window.
LINE_WIDTH = 78
# A key's name in a text is no longer.
LONGEST_NAME = 20


def direction_words(direction: Direction) -> str:
    """Return where a motion key drives."""
    parts = [
        ('forward', 'back')[direction.x < 0] if direction.x else '',
        ('left', 'right')[direction.y < 0] if direction.y else '',
        ('up', 'down')[direction.z < 0] if direction.z else '',
        ('turn left', 'turn right')[direction.yaw < 0] if direction.yaw else '',
    ]
    return ' + '.join(part for part in parts if part) or 'stand'


def factor_words(factor: SpeedFactor) -> str:
    """Return what a speed key does."""
    if factor.linear == factor.angular != 1.0:
        return f'both {100.0 * (factor.linear - 1.0):+.0f} %'
    parts = [
        f'{name} {100.0 * (value - 1.0):+.0f} %'
        for name, value in zip(('speed', 'turn'), factor, strict=True)
        if value != 1.0
    ]
    return ', '.join(parts) or 'nothing'


def key_words(key: str) -> str:
    """Return how a key is called in a text; from a topic it may be longer than any name."""
    return 'SPACE' if key == ' ' else key[:LONGEST_NAME]


def table_lines(keymap: Keymap) -> list[str]:
    """Return one line for each meaning, with the keys that have it."""
    return [f'  {keys:12} {meaning}'[:LINE_WIDTH] for keys, meaning in _rows(keymap)]


def help_table(keymap: Keymap) -> list[str]:
    """Return the same in as many columns as fit: a help that leaves room for a dashboard."""
    cells = [f'{keys:3} {meaning}'[:LINE_WIDTH] for keys, meaning in _rows(keymap)]
    for count in (3, 2, 1):
        height = math.ceil(len(cells) / count)
        columns = [cells[start : start + height] for start in range(0, len(cells), height)]
        widths = [max(map(len, column)) + 2 for column in columns]
        if sum(widths) - 2 <= LINE_WIDTH:
            break
    rows = itertools.zip_longest(*columns, fillvalue='')
    return [''.join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _rows(keymap: Keymap) -> list[tuple[str, str]]:
    """Return the keys of each meaning and the meaning, in the order of the keymap."""
    rows = [
        *_grouped({key: direction_words(way) for key, way in keymap.motion.items()}),
        *_grouped({key: factor_words(way) for key, way in keymap.speed_keys.items()}),
    ]
    if keymap.stop_keys:
        rows.append((sorted(keymap.stop_keys), 'stop at once'))
    if keymap.other_keys == 'stop':
        rows.append((['any other'], 'stop on the ramp'))
    return [(' '.join(map(key_words, keys)), meaning) for keys, meaning in rows]


def _grouped(meanings: Mapping[str, str]) -> list[tuple[list[str], str]]:
    """Return the keys of each meaning, in the order of the keymap."""
    groups: dict[str, list[str]] = {}
    for key, meaning in meanings.items():
        groups.setdefault(meaning, []).append(key)
    return [(keys, meaning) for meaning, keys in groups.items()]
