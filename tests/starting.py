# SPDX-License-Identifier: Apache-2.0
"""
Starts our programs for tests, most of them by forking a process that has loaded them already.

Starting `wasd` takes one to three seconds of a processor, nearly all of it imports, and tests do
so some hundred times. What is forked is a real process (tests/preloaded.py). Whatever is about
the start itself uses `subprocess`; with WASD_TEST_EXEC=1 in the environment all tests do.
"""

import atexit
from collections.abc import Sequence
import ctypes
import functools
import json
import os
from pathlib import Path
import socket
import subprocess
import sys
from typing import Any

# Variables that a process may have otherwise than the one it is forked from: they are read when
# they are needed. All others are read by imports, or may be.
LATE = ('ROS_', 'FASTRTPS_', 'PYTHON_COLORS', 'TERM', 'COLUMNS', 'LINES', 'HOME', 'XDG_', 'TMPDIR')
LATE += ('PYTEST_', 'WASD_', 'PYGLFW_')
# Makes the pseudo-terminal on standard input the controlling terminal, as a shell's terminal is:
# then Ctrl-C, typed, is a signal.
TAKE_TERMINAL = (
    'import fcntl, os, sys, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0);'
    'os.execv(sys.executable, [sys.executable, *sys.argv[1:]])'
)
PR_SET_CHILD_SUBREAPER = 36
# Where programs of the tests themselves are; what is forked knows it already.
TESTS = str(Path(__file__).resolve().parent)
OPTIONS = {'cwd', 'env', 'stdin', 'stdout', 'stderr', 'text', 'start_new_session'}

_AT_FIRST = dict(os.environ)


class Popen(subprocess.Popen):  # type: ignore[type-arg]
    """
    A process of Python as `subprocess` has it: forked where that comes to the same.

    `machine` is a process with interfaces and mounts of its own, which the new one shares.
    """

    def __init__(
        self, words: Sequence[str | Path], machine: int | None = None, **options: Any
    ) -> None:
        self._request = _request(list(map(str, words)), options)
        if machine is not None and self._request:
            self._request['machine'] = machine
        elif machine is not None:
            target = ('--target', str(machine), '--net', '--mount')
            words = ['nsenter', *target, '--', *words]
        super().__init__(words, **options)

    def _execute_child(self, *arguments: Any) -> None:
        link = self._request and _preloaded()
        if not link:
            super()._execute_child(*arguments)  # type: ignore[misc]
            return
        sys.audit('subprocess.Popen', sys.executable, self.args, None, None)
        # Both ends of each stream, -1 where there is none: the child reads from the first of
        # standard input, and writes to the second of the others.
        ends = arguments[10:16]
        wanted = enumerate((ends[0], ends[3], ends[5]))
        self.pid = _fork(link, self._request, [end if end >= 0 else n for n, end in wanted])
        self._child_created = True
        self._close_pipe_fds(*ends)  # type: ignore[attr-defined]


def run(
    words: Sequence[str | Path],
    timeout: float,
    input: Any = None,
    **options: Any,
) -> 'subprocess.CompletedProcess[Any]':
    """Start our program, wait for its end and return what it has said."""
    options = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, **options}
    if input is not None:
        options['stdin'] = subprocess.PIPE
    with Popen(words, **options) as process:
        try:
            said, errors = process.communicate(input, timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(words, process.returncode, said, errors)


def _request(words: list[str], options: dict[str, Any]) -> dict[str, Any] | None:
    """Return what to become, or None where only a start from the beginning is the same."""
    takes_terminal = words[1:3] == ['-c', TAKE_TERMINAL]
    program = [words[0], *words[3:]] if takes_terminal else words
    environment = {**(os.environ if options.get('env') is None else options['env'])}
    differing = {name for name, _ in environment.items() ^ _AT_FIRST.items()}
    if environment.get('PYTHONPATH') == TESTS:
        differing.discard('PYTHONPATH')
    if (
        os.environ.get('WASD_TEST_EXEC')
        or program[:2] != [sys.executable, '-m']
        or set(options) - OPTIONS
        or not all(name.startswith(LATE) for name in differing)
    ):
        return None
    return {
        'module': program[2],
        'words': program[3:],
        'environment': environment,
        'folder': str(options.get('cwd') or Path.cwd()),
        'session': takes_terminal or bool(options.get('start_new_session')),
        'terminal': takes_terminal,
    }


@functools.cache
def _preloaded() -> socket.socket | None:
    """Return the way to the process that forks; None when it cannot load what it should."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        program = (sys.executable, str(Path(__file__).with_name('preloaded.py')))
        process = subprocess.Popen(
            [*program, str(theirs.fileno())],
            env=_AT_FIRST,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
    atexit.register(process.wait)
    atexit.register(ours.close)  # before it waits
    return ours if ours.recv(16) else None


def _fork(link: socket.socket, request: dict[str, Any], streams: list[int]) -> int:
    """Return the number of a new process, which is our child."""
    prctl = ctypes.CDLL(None).prctl
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    try:
        socket.send_fds(link, [json.dumps(request).encode()], streams)
        return int(link.recv(32))
    finally:
        prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
