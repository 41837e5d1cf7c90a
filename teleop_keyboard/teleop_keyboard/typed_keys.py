# SPDX-License-Identifier: Apache-2.0
"""The keys of a person at a terminal, out of its bytes; pasted text is none of them."""

from wasd_core.timing import is_press, STOP_KEY

from teleop_keyboard.decoder import KeyDecoder
from teleop_keyboard.hold import SHORTEST_GAP
from teleop_keyboard.keymap import SIGNAL_KEYS

# No keyboard repeats faster [1/s].
FASTEST = 1.0 / SHORTEST_GAP
# So many keys may come in one instant: a connection that stutters delivers repeats together.
MOST_AT_ONCE = 64
# What has waited for longer is no key that somebody holds [s].
LONGEST_WAIT = 0.5
# Typing begins again when so many might come: at 30 Hz after 0.3 s.
ENOUGH = 20
# What stands around a paste, where a terminal tells.
PASTE_BEGIN, PASTE_END = b'\x1b[200~', b'\x1b[201~'
# The end of a paste is lost when nothing more comes for so long [s].
PASTE_TIMEOUT = 0.5


class TypingSpeed:
    """
    Knows whether keys come faster than a person can type or hold them.

    A bucket that holds `most`: each key takes one out, time puts FASTEST a second in. Where it is
    empty the text is no typing, and what follows is none until it has come slowly for a while. It
    reads no clock.
    """

    def __init__(self, most: int = MOST_AT_ONCE) -> None:
        self._most = self._left = float(most)
        self.is_exceeded = False

    def take(self, count: int, dt: float) -> bool:
        """Take `count` keys that came within `dt` [s]; return whether they are no typing."""
        left = self._left + FASTEST * min(max(dt, 0.0), LONGEST_WAIT) - count
        self._left = min(max(left, 0.0), self._most)
        if left < 0.0:
            self.is_exceeded = True
        elif self._left >= ENOUGH:
            self.is_exceeded = False
        return self.is_exceeded


class Pastes:
    """Takes what is pasted out of bytes, where it is marked, however the bytes are cut."""

    def __init__(self) -> None:
        self.is_open = False
        self.count = 0
        self._before = b''  # what may be the start of the mark that is looked for
        self._silence = 0.0

    def strip(self, data: bytes, dt: float) -> bytes:
        """Return bytes that came within `dt` [s] without what is pasted; the marks stay."""
        self._silence = 0.0 if data else self._silence + dt
        if self.is_open and self._silence >= PASTE_TIMEOUT:
            self._turn(False)
        typed = b''
        while data:
            mark = PASTE_END if self.is_open else PASTE_BEGIN
            before = len(self._before)
            known = self._before + data
            at = known.find(mark)
            end = len(known) if at < 0 else at + len(mark)
            typed += b'' if self.is_open else known[before:end]
            self._before = known[1 - len(mark) :]
            data = known[end:]
            if at >= 0:
                self._turn(not self.is_open)
        return typed

    def _turn(self, is_open: bool) -> None:
        self.is_open = is_open
        self.count += is_open
        self._before = b''


class TypedKeys:
    """
    Turns the bytes of a terminal into keys that a person types and holds.

    Text that is marked as pasted is passed over, and so is text that comes faster than a person
    types; that ends every motion, by STOP. So does a terminal that tells no more of a key that it
    told to be down. `most` keys may come in one instant. It reads no clock.
    """

    def __init__(self, decoder: KeyDecoder, most: int = MOST_AT_ONCE) -> None:
        self._decoder = decoder
        self._pastes = Pastes()
        self._speed = TypingSpeed(most)
        self._floods = 0

    @property
    def passes_over(self) -> bool:
        """Whether what comes next is text."""
        return self._pastes.is_open or self._speed.is_exceeded

    @property
    def texts(self) -> int:
        """How many texts were passed over."""
        return self._pastes.count + self._floods

    def take(self, data: bytes, dt: float) -> list[str]:
        """Return the keys of `data` that came within `dt` [s], maybe none, and what has ended."""
        self._decoder.step(dt)
        keys = self._decoder.feed(self._pastes.strip(data, dt))
        was_text = self._speed.is_exceeded
        if self._speed.take(sum(map(is_press, keys)), dt):
            # Nobody has typed that.
            ends = self._decoder.forget_down()
            keys = [key for key in keys if key in SIGNAL_KEYS]
            if not was_text:
                self._floods += 1
                keys = [*ends, STOP_KEY, *keys]
        return keys + self._decoder.give_up()
