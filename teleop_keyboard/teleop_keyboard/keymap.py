# SPDX-License-Identifier: Apache-2.0
"""What each key means: keymaps and the presets they are read from."""

from collections.abc import Mapping
import dataclasses
from dataclasses import dataclass
import difflib
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from wasd_core.parameters import InvalidParameter
from wasd_core.safe_files import read_text

from teleop_keyboard.layouts import on_layout

MODES = ('hold', 'latch', 'step')
OTHER_KEYS = ('stop', 'ignore')
IDLE_POLICIES = ('silent', 'zeros', 'repeat')


class KeymapError(InvalidParameter):
    """A keymap cannot be used; says file, line, key, what came and what is wanted."""


class Direction(NamedTuple):
    """Shares of full speed and turn, in [-1, 1]: forward, to the left, up, counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


class SpeedFactor(NamedTuple):
    """What a speed key multiplies speed and turn by."""

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


def preset_names() -> tuple[str, ...]:
    """Return the names of the built-in presets."""
    entries = resources.files('teleop_keyboard').joinpath('presets').iterdir()
    return tuple(
        sorted(Path(entry.name).stem for entry in entries if entry.name.endswith('.yaml'))
    )


def load_preset(name_or_path: str, layout: str = 'qwerty') -> Keymap:
    """
    Return a built-in preset by name, or the keymap in a YAML file by path.

    Keymaps name the keys of a qwerty keyboard; on another `layout` the same places are meant.

    Raises:
        KeymapError: when there is no such preset or file, or when it is not valid.
    """
    keymap = _load(name_or_path)
    return keymap if layout == 'qwerty' else _moved(keymap, layout)


def _moved(keymap: Keymap, layout: str) -> Keymap:
    """Return the keymap with its keys at the same places of another keyboard."""
    # Here, because it needs the classes above.
    from teleop_keyboard.keymap_text import help_table

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
    title = *keymap.help_lines[:1], f'keyboard {layout}'
    return dataclasses.replace(moved, help_lines=(', '.join(title), *help_table(moved)))


def _load(name_or_path: str) -> Keymap:
    # Here, because the reader builds the classes above.
    from teleop_keyboard.keymap_reader import read_keymap

    names = preset_names()
    if name_or_path in names:
        file = resources.files('teleop_keyboard').joinpath('presets', f'{name_or_path}.yaml')
        return read_keymap(file.read_text(encoding='utf-8'), f'{name_or_path}.yaml', name_or_path)
    path = Path(name_or_path).expanduser()
    if '/' not in name_or_path and path.suffix not in ('.yaml', '.yml'):
        near = difflib.get_close_matches(name_or_path, names, n=1)
        hint = f', did you mean {near[0]}?' if near else ''
        known = ', '.join(names)
        raise KeymapError(
            f'unknown preset {name_or_path!r}{hint} (known: {known}, or the path of a .yaml file)'
        )
    try:
        text = read_text(path)
    except OSError as error:
        raise KeymapError(f'{name_or_path}: cannot read the keymap: {error.strerror}') from None
    except UnicodeDecodeError as error:
        line = error.object.count(b'\n', 0, error.start) + 1
        raise KeymapError(f'{name_or_path}:{line}: not UTF-8 text') from None
    return read_keymap(text, name_or_path, path.stem)
