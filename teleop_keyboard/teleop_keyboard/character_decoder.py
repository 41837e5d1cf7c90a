# SPDX-License-Identifier: Apache-2.0
"""Bytes of a terminal to single characters."""

import codecs


class CharacterDecoder:
    """Turns bytes into characters, control characters included: what the tutorials publish."""

    pending = False
    down: tuple[str, ...] = ()
    speaks_kitty = False
    dropped = 0

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder('utf-8')('replace')

    def feed(self, data: bytes) -> list[str]:
        """Return the characters completed by `data`."""
        return list(self._decoder.decode(data))

    def flush(self) -> list[str]:
        """Return nothing: no character waits for its end in vain."""
        return []

    def forget_down(self) -> list[str]:
        """Return nothing: releases are not told."""
        return []
