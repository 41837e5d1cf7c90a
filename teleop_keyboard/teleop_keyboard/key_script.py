# SPDX-License-Identifier: Apache-2.0
"""
Scripted keys.

Lines `t key [key ...]`: at `t` seconds of simulated time each key is pressed; `key*N` stands for
a key that is held, N presses at a keyboard's repeat rate. `#` starts a comment.
"""

import math
import re
from typing import NamedTuple

from wasd_core.errors import UserError
from wasd_core.output_file import OutputFile
from wasd_core.timing import REPEAT_RATE

from teleop_keyboard.keymap import canonical_key

# More presses of one key than this are a slip of the pen: 9 hours of holding it ...
MOST_PRESSES = 1_000_000
# ... and more than this in one instant would hold the robot up; a pipe brings up to 65 536.
MOST_AT_ONCE = 100_000

# Characters that have a meaning in the format, by name.
CHARACTER_NAMES = {'STAR': '*', 'HASH': '#'}


class KeyPress(NamedTuple):
    """A key and when it is pressed [s]."""

    time: float
    key: str


class KeyScriptError(UserError):
    """A key script cannot be read; says file and line, what came and what is wanted."""


def parse_key_script(text: str, name: str = 'key script') -> list[KeyPress]:
    """
    Return the presses of a script in the order of their times; equal times keep their order.

    Raises:
        KeyScriptError: `name:line: ...` for the first line that is wrong.
    """
    presses: list[KeyPress] = []
    for number, line in enumerate(text.splitlines(), start=1):
        # No more words than may stand there: a line may be of any length.
        words = line.split('#', 1)[0].split(maxsplit=MOST_AT_ONCE + 1)
        if not words:
            continue
        try:
            presses += _line_presses(words)
            if len(presses) > MOST_PRESSES:
                raise ValueError(f'wanted at most {MOST_PRESSES} presses in a script')
        except ValueError as error:
            raise KeyScriptError(f'{name}:{number}: {error}') from None
    presses.sort(key=lambda press: press.time)
    for first, last in zip(presses, presses[MOST_AT_ONCE:], strict=False):
        if first.time == last.time:
            reason = f'wanted at most {MOST_AT_ONCE} presses at {first.time:g} s'
            raise KeyScriptError(f'{name}: {reason}')
    return presses


def _line_presses(words: list[str]) -> list[KeyPress]:
    try:
        time = float(words[0])
    except ValueError:
        time = math.nan
    if not (math.isfinite(time) and time >= 0.0):
        raise ValueError(f'got time {words[0]!r}, wanted seconds >= 0')
    if len(words) == 1:
        raise ValueError(f'got no key at {time:g} s, wanted "t key [key ...]"')
    if len(words) > 1 + MOST_AT_ONCE:
        raise ValueError(f'wanted at most {MOST_AT_ONCE} keys in a line')
    presses = []
    for word in words[1:]:
        key, count = _key_and_count(word)
        presses += [KeyPress(time + index / REPEAT_RATE, key) for index in range(count)]
    return presses


def _key_and_count(word: str) -> tuple[str, int]:
    match = re.fullmatch(r'(.+?)\*(.*)', word)
    text, count_text = (match[1], match[2]) if match else (word, '1')
    if text == '*':
        raise ValueError(f"got {word!r}, wanted STAR for the key '*'")
    if not re.fullmatch(r'[0-9]{1,9}', count_text) or not 1 <= int(count_text) <= MOST_PRESSES:
        raise ValueError(f'got {word!r}, wanted key*N with N from 1 to {MOST_PRESSES}')
    head, plus, base = text.rpartition('+')
    if plus and base in CHARACTER_NAMES:
        text = f'{head}+{CHARACTER_NAMES[base]}'
    return CHARACTER_NAMES.get(text) or canonical_key(text), int(count_text)


def script_word(key: str) -> str:
    """Return how a key stands in a script; `parse_key_script` reads it back."""
    names = {' ': 'SPACE', **{character: name for name, character in CHARACTER_NAMES.items()}}
    head, base = key[:-1], key[-1:]
    # The characters of the format stand at the end, behind modifiers: CTRL+*.
    if len(key) == 1 or head.endswith('+'):
        return head + names.get(base, base)
    return key


class KeyScriptWriter:
    """
    Writes keys to a file as a script; each line is on disk when `write` returns.

    Raises:
        OutputError: the file cannot be written; so do `write` and `close`.
    """

    def __init__(self, file: OutputFile) -> None:
        self._file = file
        file.begin()

    def write(self, time: float, key: str) -> None:
        """Write that a key came at `time` [s]; digits are kept so that a replay is exact."""
        self._file.append(f'{time!r} {script_word(key)}\n'.encode())

    def close(self) -> None:
        """Close the file."""
        self._file.close()
