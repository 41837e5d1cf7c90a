# SPDX-License-Identifier: Apache-2.0
"""
Starts our programs for tests.

A start costs a second or two of a processor, nearly all of it imports. Runs of `wasd` that end by
themselves share one process instead, one after the other: `run_wasd`.
"""

import atexit
from collections.abc import Iterable, Sequence
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


def run_wasd_together(
    commands: Iterable[Sequence[str]], folder: Path, environment: dict[str, str]
) -> 'list[subprocess.CompletedProcess[str]]':
    """Run `wasd` with each of several words, all at the same time; return what they said."""
    commands = [list(words) for words in commands]
    words = (sys.executable, __file__, json.dumps(commands))
    done = run(words, 300.0, cwd=folder, env=environment, check=True, text=True)
    answers = zip(commands, json.loads(done.stdout), strict=True)
    return [subprocess.CompletedProcess(words, *answer) for words, answer in answers]


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


def fork_for_each(commands: Sequence[Sequence[str]]) -> list[tuple[int, str, str]]:
    """Run each in a fork of this process, which has loaded what they need; return their ends."""
    from wasd_bringup.cli import main
    import wasd_bringup.tools.graph.commands  # noqa: F401

    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    with contextlib.ExitStack() as stack:
        started = []
        for words in commands:
            files = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(2)]
            pid = os.fork()
            if not pid:
                for number, file in enumerate(files, 1):
                    os.dup2(file.fileno(), number)
                status = _status_of(main, words)
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(status)
            started.append((pid, *files))
        ends = []
        for pid, said, errors in started:
            status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            ends.append((status, *(_text_of(file) for file in (said, errors))))
        return ends


def _text_of(file: Any) -> str:
    file.seek(0)
    text: bytes = file.read()
    return text.decode(errors='replace')


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
            heard |= {'said': _text_of(said), 'errors': _text_of(errors)}


if __name__ == '__main__' and len(sys.argv) > 1:
    print(json.dumps(fork_for_each(json.loads(sys.argv[1]))))
elif __name__ == '__main__':
    # Their own descriptors: 0, 1 and 2 belong to the runs.
    serve(os.fdopen(os.dup(0)), os.fdopen(os.dup(1), 'w'))
