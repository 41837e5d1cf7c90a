# SPDX-License-Identifier: Apache-2.0
"""What is said of a key that does not drive: what it does, and which keys do."""

from teleop_keyboard.key_names import split_event
from teleop_keyboard.keymap import Direction
from teleop_keyboard.keymap import Keymap
from teleop_keyboard.keymap import SpeedFactor
from teleop_keyboard.keymap_text import direction_words
from teleop_keyboard.keymap_text import factor_words
from teleop_keyboard.keymap_text import key_words
from teleop_keyboard.keys_to_twist import KeysToTwist

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


def asks_for_help(key: str, keymap: Keymap) -> bool:
    """Return whether a key shows the keys, and means nothing to the keymap."""
    return key in HELP_KEYS and key not in keymap.keys


def is_press(key: str) -> bool:
    """Return whether a message on `keys` is a press, not the HELD or RELEASE of one."""
    return bool(key) and not split_event(key)[0]
