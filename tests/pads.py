# SPDX-License-Identifier: Apache-2.0
"""A gamepad of a pipe: what writes struct js_event as the kernel's joystick devices do."""

import contextlib
import os
from pathlib import Path
import struct

BUTTON, AXIS, INIT = 0x01, 0x02, 0x80
FULL = 32767


def event(kind: int, number: int, value: int, time: int = 0) -> bytes:
    """Return one event of linux/joystick.h."""
    return struct.pack('=IhBB', time, value, kind, number)


class PipePad:
    """
    A pad of 8 axes and 11 buttons at a path; plugged in by `plug`, gone by `unplug`.

    Nobody waits here: `plug` fails, and `try_plug` says no, before a reader has opened the path.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor: int | None = None
        os.mkfifo(path)

    def plug(self, down: tuple[int, ...] = ()) -> None:
        """Come, and tell the state as the kernel does; buttons may be down."""
        self._descriptor = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK)
        first = [event(BUTTON | INIT, n, int(n in down)) for n in range(11)]
        self.send(*first, *(event(AXIS | INIT, number, 0) for number in range(8)))

    def try_plug(self) -> bool:
        """Come, if somebody has opened the path; return whether it has."""
        with contextlib.suppress(OSError):
            self.plug()
        return self._descriptor is not None

    def send(self, *events: bytes) -> None:
        """Write events."""
        assert self._descriptor is not None
        os.write(self._descriptor, b''.join(events))

    def press(self, *numbers: int) -> None:
        """Press buttons."""
        self.send(*(event(BUTTON, number, 1) for number in numbers))

    def release(self, *numbers: int) -> None:
        """Let go of buttons."""
        self.send(*(event(BUTTON, number, 0) for number in numbers))

    def push(self, axis: int, share: float) -> None:
        """Move an axis to a share of its way: 1 is right or down, as the kernel has it."""
        self.send(event(AXIS, axis, round(share * FULL)))

    def unplug(self) -> None:
        """Go."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None
