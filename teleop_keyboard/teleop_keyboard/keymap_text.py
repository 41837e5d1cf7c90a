# SPDX-License-Identifier: Apache-2.0
"""Keymaps in words: what `wasd keys` prints, and the help of a keymap on another keyboard."""

from collections.abc import Mapping
import itertools
import math

from teleop_keyboard.keymap import Direction
from teleop_keyboard.keymap import Keymap
from teleop_keyboard.keymap import Limits
from teleop_keyboard.keymap import load_preset
from teleop_keyboard.keymap import preset_names
from teleop_keyboard.keymap import SpeedFactor

# Lines fit an 80-column window.
LINE_WIDTH = 78


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
    """Return how a key is called in a text."""
    return 'SPACE' if key == ' ' else key


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


def describe_keymap(name: str, layout: str) -> list[str]:
    """
    Return everything about a keymap that a driver wants to know.

    Raises:
        KeymapError: there is no such keymap, or it is not valid.
    """
    keymap = load_preset(name, layout)
    lines = [
        f'preset {keymap.name}, keyboard {layout}',
        f'  mode {keymap.mode}, idle {keymap.idle}, {keymap.rate:g} Hz',
        f'  speed {keymap.speed:g} m/s ({_range(keymap.speed_limits)}), '
        f'ramp {keymap.linear_accel:g} m/s^2',
        f'  turn {keymap.turn:g} rad/s ({_range(keymap.turn_limits)}), '
        f'ramp {keymap.angular_accel:g} rad/s^2',
    ]
    return [*lines, '', *table_lines(keymap)]


def _range(limits: Limits) -> str:
    return f'{limits.low:g} .. {limits.high:g}'


def list_presets() -> list[str]:
    """Return a line for each built-in preset: name, how keys count, speeds."""
    lines = []
    for name in preset_names():
        keymap = load_preset(name)
        title = keymap.help_lines[0] if keymap.help_lines else ''
        speeds = f'{keymap.speed:g} m/s, {keymap.turn:g} rad/s'
        lines.append(f'{name:14} {keymap.mode:6} {speeds:22} {title}'[:LINE_WIDTH])
    return lines
