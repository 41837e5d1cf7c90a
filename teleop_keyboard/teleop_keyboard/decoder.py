# SPDX-License-Identifier: Apache-2.0
"""Bytes of a terminal to names of keys, or to single characters."""

import codecs
from typing import NamedTuple

from teleop_keyboard.keymap import capital, with_modifiers
from teleop_keyboard.told_keys import ToldKeys

ESC = 0x1B
# No key sends a longer sequence; whatever does is dropped up to its end [bytes].
LONGEST_SEQUENCE = 64
LAST_CODE = 0x10FFFF

# Final letters shared by CSI (`ESC [ A`) and SS3 (`ESC O A`): xterm, VT220 and the Linux console.
LETTER_KEYS = {
    'A': 'UP',
    'B': 'DOWN',
    'C': 'RIGHT',
    'D': 'LEFT',
    'F': 'END',
    'H': 'HOME',
    'P': 'F1',
    'Q': 'F2',
    'R': 'F3',
    'S': 'F4',
}
# `ESC [ NUMBER ~`
NUMBER_KEYS = {
    **{1: 'HOME', 2: 'INSERT', 3: 'DELETE', 4: 'END', 5: 'PGUP', 6: 'PGDN', 7: 'HOME', 8: 'END'},
    **{11: 'F1', 12: 'F2', 13: 'F3', 14: 'F4', 15: 'F5', 17: 'F6', 18: 'F7', 19: 'F8', 20: 'F9'},
    **{21: 'F10', 23: 'F11', 24: 'F12'},
}
# rxvt marks Shift by small letters after `ESC [` and Ctrl by small letters after `ESC O`.
RXVT_KEYS = {'a': 'UP', 'b': 'DOWN', 'c': 'RIGHT', 'd': 'LEFT'}
# The number pad in application mode, `ESC O p` and so on.
PAD_KEYS = {
    'M': 'ENTER',
    'X': '=',
    **dict(zip('jklmnopqrstuvwxy', '*+,-./0123456789', strict=True)),
}
# The Linux console's F1..F5, `ESC [ [ A`.
CONSOLE_KEYS = dict(zip('ABCDE', ('F1', 'F2', 'F3', 'F4', 'F5'), strict=True))
# The number pad in kitty's protocol, by code.
KITTY_PAD_KEYS: dict[int, str] = dict(
    zip(
        range(57399, 57427),
        (*'0123456789./*-+', 'ENTER', '=', ',', 'LEFT', 'RIGHT', 'UP', 'DOWN', 'PGUP', 'PGDN')
        + ('HOME', 'END', 'INSERT', 'DELETE'),
        strict=True,
    )
)
# Types of events in kitty's protocol.
KITTY_PRESS, KITTY_REPEAT, KITTY_RELEASE = 1, 2, 3
# The answer to the question whether a terminal speaks it, and the loss of the keyboard's focus.
SPEAKS_KITTY = 'speaks kitty'
LOST_FOCUS = 'lost focus'
NOTICES = (SPEAKS_KITTY, LOST_FOCUS)
CONTROL_KEYS = {
    **{0x08: 'BACKSPACE', 0x09: 'TAB', 0x0A: 'ENTER', 0x0D: 'ENTER', 0x7F: 'BACKSPACE'},
    **{0x00: 'CTRL+SPACE', 0x1B: 'ESC'},
}


class _Piece(NamedTuple):
    """One key or one unknown sequence at the start of the bytes; `length` 0: more must come."""

    length: int
    key: str | None = None
    # Which key of the keyboard it is, whatever Shift makes of it; '' where nothing tells.
    place: str = ''
    event: int = KITTY_PRESS


_INCOMPLETE = _Piece(0)


class KeyDecoder:
    """
    Turns what a terminal sends into keys, one name each, however the bytes are cut into reads.

    It keeps the start of a sequence that has not ended yet. A lone ESC looks like such a start:
    while `pending`, the caller waits up to 50 ms for more and then calls `flush`. Any bytes will
    do: what is no key only counts in `dropped`.

    From a terminal that tells releases (kitty's protocol) it keeps the keys that are `down`; the
    end of each comes as `RELEASE+key`, also when the window lost the focus, and when nothing more
    is told: `step` lets time pass, then `give_up` returns what has ended.
    """

    def __init__(self) -> None:
        self._buffer = b''
        # Whether what comes is the rest of a sequence that is too long for a key.
        self._is_overlong = False
        self._told = ToldKeys()
        self.dropped = 0
        self.speaks_kitty = False

    @property
    def down(self) -> tuple[str, ...]:
        """Keys that were pressed and not yet released, where the terminal tells both."""
        return self._told.names if self.speaks_kitty else ()

    @property
    def pending(self) -> bool:
        """Whether bytes wait for their continuation."""
        return bool(self._buffer) or self._is_overlong

    def feed(self, data: bytes) -> list[str]:
        """Return the keys completed by `data`; unknown sequences only count in `dropped`."""
        # Byte by byte: so the keys are the same however the bytes were cut.
        keys = []
        for byte in data:
            if self._is_overlong:
                self._is_overlong = 0x20 <= byte < 0x40  # the last byte of it ends that
                if 0x20 <= byte < 0x7F:
                    continue
            if 0x20 <= byte < 0x7F and not self._buffer:
                keys.append(chr(byte))  # what people type, without a detour
                continue
            self._buffer += bytes((byte,))
            keys += self._completed()
        return keys

    def _completed(self) -> list[str]:
        """Take out of the buffer what its last byte has completed."""
        keys = []
        while self._buffer:
            piece = _first_piece(self._buffer)
            if piece.length == 0 and len(self._buffer) > LONGEST_SEQUENCE:
                piece = _Piece(len(self._buffer))
                self._is_overlong = True
            if piece.length == 0:
                break
            self._buffer = self._buffer[piece.length :]
            keys += self._events(piece)
        return keys

    def forget_down(self) -> list[str]:
        """Release all keys, as nobody will tell; return the names of these events."""
        return self._if_told(self._told.forget())

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._told.step(dt)

    def give_up(self) -> list[str]:
        """Return the events that end keys of which nothing was told for too long."""
        return self._if_told(self._told.give_up())

    def _if_told(self, events: list[str]) -> list[str]:
        return events if self.speaks_kitty else []

    def _events(self, piece: _Piece) -> list[str]:
        """Return the names of what one piece tells."""
        if piece.key in NOTICES:
            if piece.key == LOST_FOCUS:
                return self.forget_down()
            self.speaks_kitty = True
            return []
        if piece.event in (KITTY_REPEAT, KITTY_RELEASE):
            self.speaks_kitty = True  # whatever it was asked and has answered
        if piece.event == KITTY_RELEASE:
            # Under the name of its press: Shift may have been let go before.
            return self._told.release(piece.place)
        if piece.key is None:
            self.dropped += 1
            return []
        ends: list[str] = []
        if piece.place:
            ends = self._told.press(piece.place, piece.key, piece.event == KITTY_REPEAT)
        return [*self._if_told(ends), piece.key]

    def flush(self) -> list[str]:
        """Return what the waiting bytes mean if nothing follows: ESC, ALT+[, ALT+O or nothing."""
        waiting, self._buffer = self._buffer, b''
        self._is_overlong = False
        if not waiting:
            return []
        if waiting in (b'\x1b', b'\x1b[', b'\x1bO'):
            return ['ESC' if len(waiting) == 1 else 'ALT+' + waiting[1:].decode()]
        self.dropped += 1
        return []


def _first_piece(data: bytes) -> _Piece:
    if data[0] != ESC:
        return _character(data)
    if len(data) == 1:
        return _INCOMPLETE
    if data[1] == ESC:
        # Two presses of ESC, or ESC and then an arrow: the first must not get lost.
        return _Piece(1, 'ESC')
    if data[1:2] == b'[':
        return _control_sequence(data)
    if data[1:2] == b'O':
        return _single_shift(data)
    piece = _character(data[1:])
    if piece.length == 0:
        return _INCOMPLETE
    key = piece.key
    if key is not None and key.startswith('CTRL+'):
        key = 'CTRL+ALT+' + key.removeprefix('CTRL+')
    elif key is not None:
        key = with_modifiers(key, alt=True)
    return _Piece(1 + piece.length, key)


def _character(data: bytes) -> _Piece:
    """Read one control or UTF-8 character."""
    first = data[0]
    if first in CONTROL_KEYS:
        return _Piece(1, CONTROL_KEYS[first])
    if first < 0x20:
        return _Piece(1, 'CTRL+' + chr(first + 0x40))
    length = _utf8_length(first)
    for index in range(1, length):
        if index == len(data):
            return _INCOMPLETE
        if data[index] & 0xC0 != 0x80:
            return _Piece(index)
    try:
        text = data[:length].decode()
    except UnicodeDecodeError:
        return _Piece(length)
    return _Piece(length, text if text.isprintable() else None)


def _utf8_length(first: int) -> int:
    if 0xC2 <= first < 0xE0:
        return 2
    if 0xE0 <= first < 0xF0:
        return 3
    return 4 if 0xF0 <= first < 0xF5 else 1


def _control_sequence(data: bytes) -> _Piece:
    """Read `ESC [ parameters final`."""
    if data[2:3] == b'[':
        if len(data) < 4:
            return _INCOMPLETE
        return _Piece(4, CONSOLE_KEYS.get(chr(data[3])))
    for index in range(2, len(data)):
        byte = data[index]
        if 0x40 <= byte <= 0x7E:
            return _csi_piece(index + 1, data[2:index].decode(), chr(byte))
        if not 0x20 <= byte < 0x40:
            # Not a sequence after all; the byte that breaks it is a key of its own.
            return _Piece(index)
    return _INCOMPLETE


def _csi_piece(length: int, parameters: str, final: str) -> _Piece:
    if final == 'u' and parameters.startswith('?'):
        return _Piece(length, SPEAKS_KITTY)
    if final in 'IO' and not parameters:
        return _Piece(length, LOST_FOCUS if final == 'O' else None)
    # Kitty refines a number by sub-parameters: `97:65` is a with A, `5:3` Ctrl released.
    fields = [field.split(':') for field in parameters.split(';')]
    if not all(part.isdigit() or not part for field in fields for part in field):
        return _Piece(length)
    numbers = [[int(part) if part else 1 for part in field] for field in fields]
    modifiers = numbers[1] if len(numbers) > 1 else [1]
    text = _text(numbers[2]) if len(numbers) > 2 and fields[2][0] else ''
    key = _csi_key(numbers[0][0], modifiers[0], final, text)
    event = modifiers[1] if len(modifiers) > 1 else KITTY_PRESS
    return _Piece(length, key, f'{numbers[0][0]}{final}', event)


def _text(codes: list[int]) -> str:
    return ''.join(map(chr, codes)) if max(codes) <= LAST_CODE else ''


def _csi_key(number: int, modifiers: int, final: str, text: str) -> str | None:
    if final == '~':
        return _modified(NUMBER_KEYS.get(number), modifiers)
    if final == 'Z':
        return 'SHIFT+TAB'
    if final == 'u':
        return _unicode_key(number, modifiers, text)
    if final in RXVT_KEYS:
        return with_modifiers(RXVT_KEYS[final], shift=True)
    return _modified(LETTER_KEYS.get(final), modifiers)


def _unicode_key(code: int, modifiers: int, text: str) -> str | None:
    """Name the key of `ESC [ code ; modifiers ; text u`."""
    if code in CONTROL_KEYS and code != 0:
        return _modified(CONTROL_KEYS[code], modifiers)
    if code in KITTY_PAD_KEYS:
        return KITTY_PAD_KEYS[code]
    if code > LAST_CODE or not chr(code).isprintable():
        return None
    if (modifiers - 1) & 0x6 == 0:
        if len(text) == 1 and text.isprintable():
            return text
        return capital(chr(code)) if (modifiers - 1) & 0x1 else chr(code)
    return _modified(chr(code), modifiers)


def _single_shift(data: bytes) -> _Piece:
    """Read `ESC O letter`; old terminals put the modifiers' digit before the letter."""
    digits = 0
    while data[2 + digits : 3 + digits].isdigit() and digits < 2:
        digits += 1
    if len(data) < 3 + digits:
        return _INCOMPLETE
    letter = chr(data[2 + digits])
    if not letter.isalpha() or not letter.isascii():
        # ALT+O, and then something else.
        return _Piece(2, 'ALT+O')
    length = 3 + digits
    if letter in RXVT_KEYS:
        return _Piece(length, with_modifiers(RXVT_KEYS[letter], ctrl=True))
    modifiers = int(data[2 : 2 + digits]) if digits else 1
    return _Piece(length, _modified(LETTER_KEYS.get(letter) or PAD_KEYS.get(letter), modifiers))


def _modified(key: str | None, modifiers: int) -> str | None:
    """Name a key with xterm's modifier number: 1 + (1 Shift, 2 Alt, 4 Ctrl; others ignored)."""
    if key is None or not 1 <= modifiers <= 256:
        return None
    bits = modifiers - 1
    if bits & 7 == 1 and len(key) == 1:  # of the number pad, where it only picks the character
        return key
    return with_modifiers(key, ctrl=bool(bits & 4), alt=bool(bits & 2), shift=bool(bits & 1))


class CharacterDecoder(KeyDecoder):
    """Turns bytes into characters, control characters included: what the tutorials publish."""

    def __init__(self) -> None:
        super().__init__()
        self._decoder = codecs.getincrementaldecoder('utf-8')('replace')

    def feed(self, data: bytes) -> list[str]:
        """Return the characters completed by `data`."""
        return list(self._decoder.decode(data))
