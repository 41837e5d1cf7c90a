# SPDX-License-Identifier: Apache-2.0
"""A gamepad as a file: found, opened, read, lost and found again, without a library."""

import array
from collections.abc import Mapping
import contextlib
import errno
import fcntl
import os
from pathlib import Path
import re
import select
import stat
import time
from typing import NamedTuple

from wasd_core.errors import one_line, UserError

from teleop_keyboard.gamepad import Controls, controls_of, JoyState, Pad, USUAL_CONTROLS

FOLDER = Path('/dev/input')
# Where there is no pad one is looked for so often [s].
LOOK_PERIOD = 0.25
SHORTEST_WAIT = 0.001
# Read at most at a time [bytes]: what writes without end must not be read without end.
AT_ONCE = 4096
# Of linux/joystick.h, _IOR('j', number, size): how many axes and buttons, what each is, the name.
AXES, BUTTONS, NAME, AXIS_MAP, BUTTON_MAP = 0x11, 0x12, 0x13, 0x32, 0x34
NAME_SIZE, AXIS_MAP_SIZE, BUTTON_MAP_SIZE = 128, 64, 512


def what_else(path: str) -> str:
    """Return what there is at a path that is no joystick and no pipe; '' where nothing is."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
            return ''
        if stat.S_ISDIR(mode):
            return 'a folder'
        if not stat.S_ISCHR(mode):
            return 'a plain file' if stat.S_ISREG(mode) else 'a disk'
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except (OSError, ValueError):  # it may come, or may be allowed, later; ValueError: a NUL
        return ''
    try:
        return '' if _ask(descriptor, AXES, bytearray(1)) else 'a device that is no joystick'
    finally:
        os.close(descriptor)


class Told(NamedTuple):
    """What a look at a gamepad has brought: states in their order, and whether it was lost."""

    states: tuple[JoyState, ...] = ()
    is_lost: bool = False


class Gamepad:
    """
    The pad at a path, or the first there is; `step` looks at it and never waits, `wait` does.

    A pad is there from its first event to the error or the end that reading it brings: it was
    unplugged, it went to sleep, the writer of a pipe has gone. While it is there its state is
    told when it changes and otherwise `rate` times a second.

    Raises:
        UserError: there is something at the path that can never be a pad.
    """

    def __init__(
        self, path: str = '', deadzone: float = 0.05, rate: float = 20.0, folder: Path = FOLDER
    ) -> None:
        if kind := what_else(path):
            raise UserError(f'gamepad {path}: wanted a device as {FOLDER}/js0, got {kind}')
        self.pad = Pad(deadzone)
        self.rate = rate
        self.controls: Controls = USUAL_CONTROLS
        self.name = ''  # what the pad calls itself; '' when there is none
        self.problem = ''  # why one that is there cannot be read, in a line
        self._path = path
        self._folder = folder
        self._descriptor: int | None = None
        self.is_there = False  # a pad that has said something
        self._since_look = LOOK_PERIOD
        self._since_told = 0.0

    def wait(self) -> None:
        """Wait until there is something to see, or something else is due; in any thread."""
        descriptor = self._descriptor
        if descriptor is None:
            time.sleep(max(LOOK_PERIOD - self._since_look, SHORTEST_WAIT))
            return
        period = 1.0 / self.rate if self.is_there and self.rate > 0.0 else LOOK_PERIOD
        with contextlib.suppress(OSError, ValueError):  # closed meanwhile
            left = max(period - self._since_told, SHORTEST_WAIT)
            select.select([descriptor], [], [], left)

    def step(self, dt: float) -> Told:
        """Let `dt` [s] pass, and look."""
        if self._descriptor is None:
            self._since_look += dt
            if self._since_look < LOOK_PERIOD or not self._find():
                return Told()
        assert self._descriptor is not None
        try:
            data = os.read(self._descriptor, AT_ONCE)
            is_over = not data and self.is_there
        except BlockingIOError:
            data, is_over = b'', False
        except OSError:
            data, is_over = b'', True
        if is_over:
            return self._lose()
        self.is_there = self.is_there or bool(data)
        self._since_told += dt
        states = self.pad.take(data)
        is_due = self.rate > 0.0 and self._since_told >= 1.0 / self.rate
        if self.is_there and not states and is_due:
            states = [self.pad.state]
        if states or not self.is_there:
            self._since_told = 0.0
        return Told(tuple(states))

    def close(self) -> None:
        """Let go of the device."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None
        self.is_there = False
        self.name = ''
        self.pad.reset()

    def _lose(self) -> Told:
        was_there = self.is_there
        self.close()
        self._since_look = 0.0
        return Told(is_lost=was_there)

    def _find(self) -> bool:
        """Open the pad that is there; return whether there is one."""
        self._since_look = 0.0
        for path in [self._path] if self._path else first_pads(self._folder):
            if kind := what_else(path):
                self.problem = f'gamepad {path}: {kind}'
                continue
            try:
                self._descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            except OSError as error:
                if error.errno != errno.ENOENT:
                    self.problem = f'gamepad {path}: {one_line(error)}'
                continue
            self.problem = ''
            self.controls = _ask_controls(self._descriptor)
            name = bytearray(NAME_SIZE)
            _ask(self._descriptor, NAME, name)
            self.name = name.partition(b'\0')[0].decode('utf-8', 'replace') or path
            return True
        return False


def first_pads(folder: Path) -> list[str]:
    """Return the joystick devices of a folder, js2 before js10."""
    with contextlib.suppress(OSError):
        found = {int(match[1]) for path in folder.iterdir() if (match := _NUMBER(path.name))}
        return [str(folder / f'js{number}') for number in sorted(found)]
    return []


_NUMBER = re.compile(r'js(\d+)').fullmatch


def _ask(descriptor: int, number: int, answer: 'bytearray | array.array[int]') -> bool:
    """Ask a joystick device for one of its tables; return whether it has answered."""
    size = len(answer) * getattr(answer, 'itemsize', 1)
    request = 2 << 30 | size << 16 | ord('j') << 8 | number
    try:
        fcntl.ioctl(descriptor, request, answer)
    except OSError:
        return False
    return True


def _ask_controls(descriptor: int) -> Mapping[str, tuple[int, int]]:
    """Return where each button of a pad is, by the kernel's codes; else as most pads have it."""
    counts = bytearray(1), bytearray(1)
    axes, buttons = bytearray(AXIS_MAP_SIZE), array.array('H', [0] * BUTTON_MAP_SIZE)
    asked = (AXES, counts[0]), (BUTTONS, counts[1]), (AXIS_MAP, axes), (BUTTON_MAP, buttons)
    if not all(_ask(descriptor, number, answer) for number, answer in asked):
        return USUAL_CONTROLS
    return controls_of(list(axes)[: counts[0][0]], buttons.tolist()[: counts[1][0]])
