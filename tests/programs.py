# SPDX-License-Identifier: Apache-2.0
"""
Starts our programs for tests.

A start costs a second or two of a processor, nearly all of it imports. Runs of `wasd` that end by
themselves share one process instead, one after the other: `run_wasd`.
"""

import atexit
from collections.abc import Sequence
import contextlib
import functools
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import traceback
from typing import Any

# Becomes Python with the words that follow, whose controlling terminal is the pseudo-terminal on
# standard input, as a shell's terminal is: then Ctrl-C, typed, is a signal. Without `site` (-S)
# the first Python starts in a quarter of the time.
ON_TERMINAL = (
    *(sys.executable, '-S', '-c'),
    'import fcntl, os, sys, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0);'
    'os.execv(sys.executable, [sys.executable, *sys.argv[1:]])',
)

# Words of Python: it runs a shell's script, the next word, in which "$0" "$@" is Python with the
# other words.
IN_SHELL = (
    *('-S', '-c'),
    "import os, sys; os.execvp('sh', ['sh', '-c', sys.argv[1], sys.executable, *sys.argv[2:]])",
)


def start(
    words: Sequence[str | Path], machine: int | None = None, **options: Any
) -> 'subprocess.Popen[Any]':
    """Start a program; `machine` is a process whose interfaces and mounts it is to share."""
    if machine is not None:
        words = ['nsenter', '--target', str(machine), '--net', '--mount', '--', *words]
    return subprocess.Popen(words, **options)


def run(
    words: Sequence[str | Path],
    timeout: float,
    **options: Any,
) -> 'subprocess.CompletedProcess[Any]':
    """Start a program, wait for its end and return what it has said."""
    return subprocess.run(words, timeout=timeout, capture_output=True, **options)


def run_wasd(
    words: Sequence[str], folder: Path, environment: dict[str, str]
) -> 'subprocess.CompletedProcess[str]':
    """Run `wasd` without a terminal in the process that such runs share; return what it said."""
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    request = {'words': list(words), 'folder': str(folder), 'environment': environment}
    server.stdin.write(json.dumps(request) + '\n')
    server.stdin.flush()
    answer = json.loads(server.stdout.readline())
    return subprocess.CompletedProcess(words, answer['status'], answer['said'], answer['errors'])


@functools.cache
def _server() -> 'subprocess.Popen[str]':
    pipe = subprocess.PIPE
    server = subprocess.Popen([sys.executable, __file__], stdin=pipe, stdout=pipe, text=True)
    atexit.register(server.kill)
    return server


def serve(requests: Any, answers: Any) -> None:
    """Run what each line asks for, as a program of its own would, and answer by a line."""
    import expansions
    import robot_description.description  # noqa: F401
    from wasd_bringup.cli import main

    expansions.remember()
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    streams = sys.stdout, sys.stderr
    for line in requests:
        request = json.loads(line)
        os.environ.clear()
        os.environ.update(request['environment'])
        os.chdir(request['folder'])
        sys.stdout, sys.stderr = streams  # a run puts its own in place
        with _heard() as heard:
            status = _status_of(main, request['words'])
        answers.write(json.dumps({'status': status, **heard}) + '\n')
        answers.flush()


def _status_of(main: Any, words: list[str]) -> int:
    try:
        return int(main(words))
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1


@contextlib.contextmanager
def _heard() -> Any:
    """Context whose standard output and error become `said` and `errors` of what it yields."""
    heard: dict[str, str] = {}
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as errors:
        os.dup2(said.fileno(), 1)
        os.dup2(errors.fileno(), 2)
        try:
            yield heard
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for name, file in (('said', said), ('errors', errors)):
                file.seek(0)
                heard[name] = file.read().decode(errors='replace')


if __name__ == '__main__':
    # Their own descriptors: 0, 1 and 2 belong to the runs.
    serve(os.fdopen(os.dup(0)), os.fdopen(os.dup(1), 'w'))
