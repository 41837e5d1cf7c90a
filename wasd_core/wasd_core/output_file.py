# SPDX-License-Identifier: Apache-2.0
"""
A file that the user asked for by an option: checked before the work begins, never half written.

A regular file is replaced at once: a reader, a crash or a kill finds the old one or the new one.
Links are followed; devices, pipes and descriptors such as /dev/stdout are written to.
"""

from collections.abc import Iterator, Sequence
import contextlib
import errno
import os
from pathlib import Path
import re
import select
import stat
import sys
import tempfile
import time

from wasd_core.errors import one_line, UserError

# So long we wait for a pipe's reader: for it to come, and then whenever it takes nothing [s].
PATIENCE = 5.0
POLL_PERIOD = 0.05
# A pipe that can be written to takes so many bytes without waiting [B].
PIECE = select.PIPE_BUF


class OutputError(UserError):
    """An output cannot be written; the text is one line: option, path, reason."""


class OutputFile:
    """
    The output file of an option; `write` it whole, or `begin`, `append` and `close` it.

    Raises:
        OutputError: it cannot be written, as far as can be told before. Nothing is changed yet.
    """

    def __init__(self, path: str | Path, option: str) -> None:
        self.path = Path(path)
        self.option = option
        self._file: int | None = None
        try:
            self._target = os.path.realpath(path)
            self.is_regular = self._check(os.fspath(path))
        except OutputError:
            raise
        except (OSError, ValueError) as error:  # ValueError: a NUL in the name
            raise self._error(error) from None

    def __str__(self) -> str:
        """Return the path as it was given."""
        return str(self.path)

    @property
    def is_standard_output(self) -> bool:
        """Whether it is where this process prints to, and no file."""
        return not self.is_regular and identity('/dev/stdout') == identity(self.path)

    def write(self, data: bytes) -> None:
        """
        Make these bytes all that is in the file.

        Raises:
            OutputError: the disk is full, or the like; a regular file is then as it was.
        """
        self.begin(data)
        self.close()

    def begin(self, data: bytes = b'') -> None:
        """
        Make these bytes the beginning of the file, which `append` continues.

        Raises:
            OutputError: as `write`.
        """
        with self._one_line():
            (self._replace if self.is_regular else self._send)(data)

    def append(self, data: bytes) -> None:
        """
        Add to what has begun, to a regular file all of these bytes or none.

        Raises:
            OutputError: the disk is full, the pipe's reader has gone or stands still.
        """
        with self._one_line():
            self._send(data)

    def close(self) -> None:
        """
        Close what has begun.

        Raises:
            OutputError: the system had kept the data back, and now cannot write it.
        """
        file, self._file = self._file, None
        if file is not None:
            with self._one_line():
                os.close(file)

    @property
    def _descriptor(self) -> int:
        assert self._file is not None
        return self._file

    def _check(self, path: str) -> bool:
        """Open what is no regular file, try the folder of what is; return whether it is."""
        number = _own_descriptor(path)
        if number is not None:
            if number < 3 and (sys.__stdin__, sys.__stdout__, sys.__stderr__)[number] is None:
                raise OSError(errno.EBADF, os.strerror(errno.EBADF))
            self._file = os.dup(number)
            return False
        try:
            mode = os.stat(path).st_mode
        except FileNotFoundError:
            mode = stat.S_IFREG
        folder = os.path.dirname(self._target)
        if stat.S_ISDIR(mode) or not os.path.isdir(folder) or not os.path.basename(path):
            raise OutputError(f'{self._name}: wanted a file in a folder that exists')
        if not stat.S_ISREG(mode):
            self._file = _open_stream(path)
            return False
        if os.path.exists(self._target) and not os.access(self._target, os.W_OK):
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        file, name = self._new_file()
        os.close(file)
        os.unlink(name)
        return True

    def _replace(self, data: bytes) -> None:
        file, name = self._new_file()
        try:
            _write_all(file, data)
            self._take_after(file)
            os.replace(name, self._target)
        except BaseException:
            os.close(file)
            os.unlink(name)
            raise
        self._file = file

    def _new_file(self) -> tuple[int, str]:
        folder, name = os.path.split(self._target)
        return tempfile.mkstemp(dir=folder, prefix=f'.{name[:50]}.')

    def _take_after(self, file: int) -> None:
        """Give a new file the mode and owner of the one it replaces, or those of any new file."""
        try:
            old = os.stat(self._target)
        except FileNotFoundError:
            os.umask(mask := os.umask(0o077))
            os.fchmod(file, 0o666 & ~mask)
            return
        with contextlib.suppress(OSError):  # only root may give files away
            os.fchown(file, old.st_uid, old.st_gid)
        os.fchmod(file, stat.S_IMODE(old.st_mode))

    def _send(self, data: bytes) -> None:
        if self.is_regular:
            end = os.lseek(self._descriptor, 0, os.SEEK_CUR)
            try:
                _write_all(self._descriptor, data)
            except OSError:
                os.ftruncate(self._descriptor, os.lseek(self._descriptor, end, os.SEEK_SET))
                raise
            return
        # Never more than fits: a reader that stands still must not stop a robot's loop for ever.
        ready = select.poll()
        ready.register(self._descriptor, select.POLLOUT)
        view = memoryview(data)
        while view:
            if not ready.poll(1e3 * PATIENCE):
                raise OSError(errno.EAGAIN, f'nobody reads it for {PATIENCE:g} s')
            with contextlib.suppress(BlockingIOError):  # standard output may be set so
                view = view[os.write(self._descriptor, view[:PIECE]) :]

    @contextlib.contextmanager
    def _one_line(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: Exception) -> OutputError:
        return OutputError(f'{self._name}: {one_line(error)}')

    @property
    def _name(self) -> str:
        return f'{self.option} {self.path}'.strip()


def identity(path: str | Path) -> tuple[int, int, str] | None:
    """
    Return a key that is equal for all paths of one file, even before the file exists.

    None for a character device: a terminal or /dev/null takes what comes from anywhere.
    """
    try:
        target = os.path.realpath(path)
        try:
            status, name = os.stat(path), ''
        except FileNotFoundError:
            status, name = os.stat(os.path.dirname(target)), os.path.basename(target)
    except OSError:
        return None
    if stat.S_ISCHR(status.st_mode):
        return None
    return status.st_dev, status.st_ino, name


def check_apart(outputs: Sequence[OutputFile], inputs: Sequence[tuple[str, str | Path]]) -> None:
    """
    Accept outputs that are neither each other nor an input, given as option and path.

    Raises:
        OutputError: which two options name one file, by whatever links.
    """
    seen: dict[tuple[int, int, str], str] = {}
    for option, path in inputs:
        what = identity(path)
        if what is not None:
            seen.setdefault(what, f'{option} {path}'.strip())
    for output in outputs:
        what = identity(output.path)
        if what is None:
            continue
        name = f'{output.option} {output.path}'
        if what in seen:
            raise OutputError(f'{name}: is the same file as {seen[what]}')
        seen[what] = name


def _own_descriptor(path: str) -> int | None:
    """Return the number of our descriptor that a path stands for, as /dev/stdout does."""
    for _ in range(40):
        folder, name = os.path.split(os.path.abspath(path))
        found = re.fullmatch(r'/proc/(\d+)/fd', os.path.realpath(folder))
        if found and found[1] == str(os.getpid()) and name.isdigit():
            return int(name)
        if not os.path.islink(path):
            return None
        path = os.path.join(folder, os.readlink(path))
    return None


def _open_stream(path: str) -> int:
    """Open a device or a pipe to write; a pipe's reader may come a little later."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            file = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
            break
        except OSError as error:
            if error.errno != errno.ENXIO or not stat.S_ISFIFO(os.stat(path).st_mode):
                raise
            if time.monotonic() > deadline:
                raise OSError(errno.ENXIO, f'nobody reads this pipe for {PATIENCE:g} s') from None
        time.sleep(POLL_PERIOD)
    os.set_blocking(file, True)
    return file


def _write_all(file: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(file, view) :]
