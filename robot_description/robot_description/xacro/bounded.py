# SPDX-License-Identifier: Apache-2.0
"""
Runs work on strangers' files in a child process of bounded time and memory.

On Linux the child is a fork: it has all modules at once. It touches no lock but its own, also
where other threads held some: it collects no garbage of theirs, prints nothing and ends without
any clean-up. Elsewhere it is a new Python, which the wall clock alone bounds.
"""

from collections.abc import Callable, Mapping
import gc
import json
import mmap
import os
from pathlib import Path
import select
import signal
import subprocess
import sys
from typing import Any, BinaryIO, NoReturn

from wasd_core.errors import DescriptionError

CPU = 1.5  # [s]; the largest robots of others take a third of it
MEMORY = 256_000_000  # [B] above what is in use
WALL = 60.0  # [s], on a machine where others have the processor
LARGEST_ANSWER = 20_000_000  # [B]
NOTE = 4096  # [B]
NO_MEMORY = 77
CAN_FORK = sys.platform == 'linux'
# A job and where it may note what it is at, to its answer; both are JSON.
Work = Callable[[Mapping[str, Any], Callable[[Any], None]], Any]
NEW_PYTHON = """
import importlib, json, sys
sys.path[:], module, name, job = json.load(sys.stdin)
json.dump(getattr(importlib.import_module(module), name)(job, lambda note: None), sys.stdout)
"""


class OutOfBounds(DescriptionError):
    """The child took too much; `note` is what it was at, or None."""

    def __init__(self, reason: str, note: Any = None) -> None:
        super().__init__(reason)
        self.note = note


def run_bounded(work: Work, job: Mapping[str, Any]) -> Any:
    """
    Return what a function of a module answers to a job, in a process of its own.

    Raises:
        OutOfBounds: it takes more CPU time or memory than it may, or crashes Python.
    """
    return _in_fork(work, job) if CAN_FORK else _in_new_python(work, job)


def _in_fork(work: Work, job: Mapping[str, Any]) -> Any:
    reader, writer = os.pipe()
    with open(reader, 'rb') as pipe, mmap.mmap(-1, NOTE) as note:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        child = -1
        try:
            child = os.fork()
            if child == 0:
                _be_child(work, job, note, writer)
        except OSError as error:
            raise OutOfBounds(f'needs a process of its own: {error.strerror}') from None
        finally:
            os.close(writer)
            if child < 0:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        answer = None
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)  # a signal that waited comes now
            answer = _read(pipe)
        finally:
            if answer is None:
                os.kill(child, signal.SIGKILL)
            status = _wait_for(child, bool(answer))
        if answer is None or status != 0:
            at = json.loads(note[:].rstrip(b'\0') or b'null')
            raise OutOfBounds(_cause_of_death(status), at)
    return json.loads(answer)


def _read(pipe: BinaryIO) -> bytes | None:
    """Return what the child has written when it ends; None when it is late, or too much."""
    if not select.select([pipe], [], [], WALL)[0]:
        return None
    answer = pipe.read(LARGEST_ANSWER + 1)
    return answer if len(answer) <= LARGEST_ANSWER else None


def _wait_for(child: int, has_answered: bool) -> int:
    """Return how a child has ended; where the system keeps no record, by whether it answered."""
    try:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    except ChildProcessError:  # whoever started us has SIGCHLD ignored
        return 0 if has_answered else 1


def _cause_of_death(status: int) -> str:
    if status == -signal.SIGPROF:
        return f'took more than {CPU:g} s of CPU time'
    if status == NO_MEMORY:
        return f'took more than {MEMORY / 1e6:g} MB'
    if status in (0, -signal.SIGKILL):  # it may have ended before we gave up on it
        return f'took more than {WALL:g} s, or made more than {LARGEST_ANSWER / 1e6:g} MB'
    if status == -signal.SIGSEGV:
        return 'ended Python: nested too deep?'
    return f'ended Python ({signal.Signals(-status).name if status < 0 else status})'


def _be_child(work: Work, job: Mapping[str, Any], note: mmap.mmap, writer: int) -> NoReturn:
    status = 1
    try:
        gc.freeze()  # what others made is not ours to clean up
        _bound()

        def write(what: Any) -> None:
            text = json.dumps(what).encode()
            if len(text) <= NOTE:
                note[:] = text.ljust(NOTE, b'\0')

        data = json.dumps(work(job, write)).encode()
        with open(writer, 'wb') as pipe:
            pipe.write(data)
        status = 0
    except MemoryError:
        status = NO_MEMORY
    finally:
        os._exit(status)


def _bound() -> None:
    """Bound this process. Signals stay blocked: what Ctrl-C ends is for the parent to say."""
    import resource  # Unix has it

    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGPROF,))
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    for limit, wanted in (
        (resource.RLIMIT_AS, pages * resource.getpagesize() + MEMORY),
        (resource.RLIMIT_CORE, 0),
    ):
        most = resource.getrlimit(limit)[1]
        soft = wanted if most == resource.RLIM_INFINITY else min(wanted, most)
        resource.setrlimit(limit, (soft, most))
    signal.setitimer(signal.ITIMER_PROF, CPU)


def _in_new_python(work: Work, job: Mapping[str, Any]) -> Any:
    order = json.dumps([sys.path, work.__module__, work.__name__, job])
    command = [sys.executable, '-I', '-c', NEW_PYTHON]
    try:
        done = subprocess.run(command, input=order, capture_output=True, text=True, timeout=WALL)
    except subprocess.TimeoutExpired:
        raise OutOfBounds(f'took more than {WALL:g} s') from None
    if done.returncode:
        raise OutOfBounds(f'ended Python ({done.stderr.strip().rpartition(chr(10))[2]})')
    return json.loads(done.stdout)
