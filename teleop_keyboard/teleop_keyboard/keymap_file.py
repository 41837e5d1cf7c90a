# SPDX-License-Identifier: Apache-2.0
"""
Keymaps from YAML: the built-in presets and files of users, on any keyboard.

The reader works on YAML nodes and not on loaded values: nodes know their lines, and a key such as
`1` or `~` stays the character that it is.
"""

from collections.abc import Callable, Sequence
import dataclasses
import functools
from importlib import resources
import math
import os
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, TypeVar

from wasd_core.errors import did_you_mean, one_line
from wasd_core.parameter_file import compose_yaml, read_text
from wasd_core.parameters import LONGEST_SHOWN, shown
from wasd_core.timing import ALIASES, split_event
import yaml

from teleop_keyboard.keymap import (
    canonical_key,
    capital,
    Direction,
    help_table,
    HIGHEST_ACCEL,
    HIGHEST_RATE,
    HIGHEST_SPEED,
    IDLE_POLICIES,
    Keymap,
    KeymapError,
    Limits,
    LINE_WIDTH,
    LOWEST_ACCEL,
    LOWEST_RATE,
    MODES,
    on_layout,
    OTHER_KEYS,
    SIGNAL_KEYS,
    SpeedFactor,
    table_lines,
)


def preset_names() -> tuple[str, ...]:
    """Return the names of the built-in presets."""
    entries = resources.files('teleop_keyboard').joinpath('presets').iterdir()
    return tuple(
        sorted(Path(entry.name).stem for entry in entries if entry.name.endswith('.yaml'))
    )


def load_preset(name_or_path: str, layout: str = 'qwerty', others: Sequence[str] = ()) -> Keymap:
    """
    Return a built-in preset by name, or the keymap in a YAML file by path.

    Keymaps name the keys of a qwerty keyboard; on another `layout` the same places are meant.
    `others` are names that the caller knows beside those of keymaps.

    Raises:
        KeymapError: when there is no such preset or file, or when it is not valid.
    """
    keymap = _load(name_or_path, others)
    return keymap if layout == 'qwerty' else _with_keys_of_layout(keymap, layout)


def _with_keys_of_layout(keymap: Keymap, layout: str) -> Keymap:
    """Return the keymap with its keys at the same places of another keyboard."""
    names = {key: on_layout(key, layout) for key in keymap.keys}
    if len(set(names.values())) < len(names):
        twice = [key for key, name in names.items() if list(names.values()).count(name) > 1]
        raise KeymapError(f'{keymap.name}: {" and ".join(twice)} are one key on {layout}')
    moved = dataclasses.replace(
        keymap,
        motion=MappingProxyType({names[key]: way for key, way in keymap.motion.items()}),
        speed_keys=MappingProxyType({names[key]: f for key, f in keymap.speed_keys.items()}),
        stop_keys=frozenset(names[key] for key in keymap.stop_keys),
    )
    title = f'preset {keymap.name}, keyboard {layout}'  # the keymap's own may name its keys
    return dataclasses.replace(moved, help_lines=(title, *help_table(moved)))


def _load(name_or_path: str, others: Sequence[str]) -> Keymap:
    if name_or_path in preset_names():
        return _built_in(name_or_path)
    path = Path(os.path.expanduser(name_or_path))  # an unknown user stays
    if '/' not in name_or_path and path.suffix not in ('.yaml', '.yml'):
        names = (*preset_names(), *others)
        hint = did_you_mean(name_or_path, names)
        known = ', '.join(names)
        raise KeymapError(
            f'unknown preset {name_or_path!r}{hint} (known: {known}, or the path of a .yaml file)'
        )
    try:
        text = read_text(path)
    except OSError as error:
        raise KeymapError(f'{name_or_path}: cannot read the keymap: {one_line(error)}') from None
    except UnicodeDecodeError as error:
        line = error.object.count(b'\n', 0, error.start) + 1
        raise KeymapError(f'{name_or_path}:{line}: not UTF-8 text') from None
    return read_keymap(text, name_or_path, path.stem)


@functools.cache
def _built_in(name: str) -> Keymap:
    file = resources.files('teleop_keyboard').joinpath('presets', f'{name}.yaml')
    return read_keymap(file.read_text(encoding='utf-8'), f'{name}.yaml', name)


def describe_keymap(name: str, layout: str, others: Sequence[str] = ()) -> list[str]:
    """
    Return everything about a keymap that a driver wants to know; `others` as in `load_preset`.

    Raises:
        KeymapError: there is no such keymap, or it is not valid.
    """
    keymap = load_preset(name, layout, others)
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


Value = TypeVar('Value')

REQUIRED = ('motion', 'speed', 'turn', 'linear_accel', 'angular_accel')
OPTIONAL = (
    *('help', 'mode', 'other_keys', 'first_character_only', 'idle', 'rate'),
    *('speed_limits', 'turn_limits', 'speed_keys', 'stop'),
)


def read_keymap(text: str, file_name: str, name: str) -> Keymap:
    """
    Return the keymap written in YAML `text`.

    Raises:
        KeymapError: names `file_name`, the line, the key, what came and what is wanted.
    """
    try:
        root = compose_yaml(text, expands=False)
    except yaml.YAMLError as error:
        raise KeymapError(f'{file_name}:{_place_and_problem(error, text)}') from None
    if not isinstance(root, yaml.MappingNode):
        raise KeymapError(f'{file_name}:1: a keymap must be a YAML mapping')
    return _KeymapReader(file_name, root).keymap(name)


def _place_and_problem(error: yaml.YAMLError, text: str) -> str:
    """Return the line and what is wrong there."""
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count('\n', 0, error.position) + 1
        return f'{line}: {error.reason}'
    mark = error.problem_mark if isinstance(error, yaml.MarkedYAMLError) else None
    problem = getattr(error, 'problem', None) or 'not YAML'
    return f'{mark.line + 1 if mark is not None else 1}: {problem}'


class _KeymapReader:
    """Reads the fields of one keymap; every complaint leads to the place in the file."""

    def __init__(self, file_name: str, root: yaml.MappingNode) -> None:
        self._file_name = file_name
        self._fields = self._mapping(root, 'the keymap')
        for field, node in self._fields.items():
            if field not in (*REQUIRED, *OPTIONAL):
                hint = did_you_mean(field, (*REQUIRED, *OPTIONAL))
                self._fail(node, field, f'unknown field{hint}')
        for field in REQUIRED:
            if field not in self._fields:
                self._fail(root, field, 'is missing')

    def keymap(self, name: str) -> Keymap:
        """Return the keymap; fields that may be left out get their defaults."""
        motion = self._table('motion', self._direction)
        if not motion:
            self._fail(self._fields['motion'], 'motion', 'names no key, wanted one or more')
        speed_keys = self._table('speed_keys', self._speed_factor)
        stop_keys = self._stop_keys()
        self._check_unique({'motion': motion, 'speed_keys': speed_keys, 'stop': stop_keys})
        speed_limits = self._limits('speed_limits')
        turn_limits = self._limits('turn_limits')
        return Keymap(
            name=name,
            motion=MappingProxyType(motion),
            speed_keys=MappingProxyType(speed_keys),
            stop_keys=frozenset(stop_keys),
            help_lines=tuple(self._text('help', '').rstrip().splitlines()),
            mode=self._choice('mode', MODES),
            other_keys=self._choice('other_keys', OTHER_KEYS),
            first_character_only=self._choice('first_character_only', ('false', 'true')) == 'true',
            idle=self._choice('idle', IDLE_POLICIES),
            rate=self._bounded('rate', 50.0, LOWEST_RATE, HIGHEST_RATE),
            speed=self._within('speed', speed_limits),
            turn=self._within('turn', turn_limits),
            speed_limits=speed_limits,
            turn_limits=turn_limits,
            linear_accel=self._bounded('linear_accel', None, LOWEST_ACCEL, HIGHEST_ACCEL),
            angular_accel=self._bounded('angular_accel', None, LOWEST_ACCEL, HIGHEST_ACCEL),
        )

    def _fail(self, node: yaml.Node, key: str, problem: str) -> NoReturn:
        line = node.start_mark.line + 1
        is_plain = key.isprintable() and len(key) <= LONGEST_SHOWN
        name = key if is_plain else shown(key)
        raise KeymapError(f'{self._file_name}:{line}: {name}: {problem}')

    def _mapping(self, node: yaml.Node, where: str) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            self._fail(node, where, 'must be a mapping')
        found: dict[str, yaml.Node] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                self._fail(key, where, 'a key must be text')
            if key.value in found:
                self._fail(key, key.value, 'appears here for the second time')
            found[key.value] = value
        return found

    def _table(self, field: str, convert: Callable[[yaml.Node, str], Value]) -> dict[str, Value]:
        if field not in self._fields:
            return {}
        table: dict[str, Value] = {}
        for text, node in self._mapping(self._fields[field], field).items():
            key = self._key(node, text)
            if key in table:
                self._fail(node, text, 'is bound for the second time')
            table[key] = convert(node, text)
        return table

    def _key(self, node: yaml.Node, text: str) -> str:
        try:
            key = canonical_key(text)
        except ValueError as error:
            self._fail(node, repr(text), str(error))
        if key in SIGNAL_KEYS:
            self._fail(node, text, 'ends or suspends the program, and never arrives as a key')
        if split_event(key)[0]:
            self._fail(node, text, 'is no press: name the key alone')
        base = key.removeprefix('SHIFT+')
        if base != key and len(ALIASES.get(base, base)) == 1:
            typed = capital(base)
            # Which character Shift makes of a digit only the keyboard knows.
            example = f', as {typed}' if typed != base.lower() else ''
            self._fail(node, text, f'never arrives: name the character that it types{example}')
        return key

    def _direction(self, node: yaml.Node, key: str) -> Direction:
        """Read [forward, left, counter-clockwise], or four shares, of which the third is up."""
        if isinstance(node, yaml.SequenceNode) and len(node.value) == 4:
            x, y, z, yaw = self._numbers(node, key, 4, '')
        else:
            x, y, yaw = self._numbers(node, key, 3, '[forward, left, counter-clockwise]')
            z = 0.0
        direction = Direction(x, y, z, yaw)
        if any(abs(share) > 1.0 for share in direction):
            got = next(share for share in direction if abs(share) > 1.0)
            self._fail(node, key, f'each share must be within -1 and 1, got {got:g}')
        return direction

    def _speed_factor(self, node: yaml.Node, key: str) -> SpeedFactor:
        values = self._numbers(node, key, 2, '[factor of speed, factor of turn]')
        if not all(value > 0.0 for value in values):
            self._fail(node, key, f'both factors must be > 0, got {values}')
        return SpeedFactor(*values)

    def _limits(self, field: str) -> Limits:
        if field not in self._fields:
            return Limits(0.0, HIGHEST_SPEED)
        node = self._fields[field]
        low, high = self._numbers(node, field, 2, '[smallest, largest]')
        if not 0.0 <= low <= high <= HIGHEST_SPEED:
            wanted = f'0 <= smallest <= largest <= {HIGHEST_SPEED:g}'
            self._fail(node, field, f'must be {wanted}, got [{low:g}, {high:g}]')
        return Limits(low, high)

    def _stop_keys(self) -> list[str]:
        node = self._fields.get('stop')
        if node is None:
            return []
        if not isinstance(node, yaml.SequenceNode):
            self._fail(node, 'stop', 'must be a list of keys')
        return [self._key(item, self._scalar(item, 'stop')) for item in node.value]

    def _check_unique(self, tables: dict[str, Any]) -> None:
        owners: dict[str, str] = {}
        for field, keys in tables.items():
            for key in keys:
                if key in owners:
                    problem = f'key {key!r} is bound under {owners[key]}, too'
                    self._fail(self._fields[field], field, problem)
                owners[key] = field

    def _numbers(self, node: yaml.Node, key: str, count: int, wanted: str) -> list[float]:
        if not isinstance(node, yaml.SequenceNode) or len(node.value) != count:
            self._fail(node, key, f'must be a list of {count} numbers {wanted}')
        return [self._number(item, key) for item in node.value]

    def _number(self, node: yaml.Node, key: str) -> float:
        text = self._scalar(node, key)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._fail(node, key, f'must be a number, got {shown(text)}')
        return value

    def _bounded(self, field: str, default: float | None, lowest: float, highest: float) -> float:
        if field not in self._fields and default is not None:
            return default
        node = self._fields[field]
        value = self._number(node, field)
        if not lowest <= value <= highest:
            wanted = f'must be >= {lowest:g} and <= {highest:g}'
            self._fail(node, field, f'{wanted}, got {value:g}')
        return value

    def _within(self, field: str, limits: Limits) -> float:
        node = self._fields[field]
        value = self._number(node, field)
        if not limits.low <= value <= limits.high:
            wanted = f'{limits.low:g} .. {limits.high:g}'
            self._fail(node, field, f'must be within {field}_limits {wanted}, got {value:g}')
        return value

    def _text(self, field: str, default: str) -> str:
        if field not in self._fields:
            return default
        return self._scalar(self._fields[field], field)

    def _choice(self, field: str, choices: tuple[str, ...]) -> str:
        text = self._text(field, choices[0])
        if text not in choices:
            wanted = ' or '.join(choices)
            self._fail(self._fields[field], field, f'must be {wanted}, got {shown(text)}')
        return text

    def _scalar(self, node: yaml.Node, key: str) -> str:
        if not isinstance(node, yaml.ScalarNode):
            self._fail(node, key, 'must be one value')
        return str(node.value)
