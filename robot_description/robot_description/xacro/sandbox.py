# SPDX-License-Identifier: Apache-2.0
"""
What strangers' files may do: expressions of known names alone, in a child process of bounded
time and memory.

On Linux the child is a fork: it has all modules at once. It touches no lock but its own, also
where other threads held some: it collects no garbage of theirs, prints nothing and ends without
any clean-up. Elsewhere it is a new Python, which the wall clock alone bounds.
"""

import ast
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
import gc
import json
import math
import mmap
import os
from pathlib import Path
import select
import signal
import string
import subprocess
import sys
from types import CodeType
from typing import Any, BinaryIO, NoReturn

from wasd_core.errors import DescriptionError

# Whose public attributes are about themselves alone, xacro's tables and YAML being dictionaries.
VALUES = (str, bytes, int, float, complex, list, tuple, dict, set, frozenset, range)
FORMATS = ('format', 'format_map')
# What expressions call for each `a.b`; two underscores begin no name that a file may use.
ATTRIBUTE = '__attribute'
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


def evaluate(text: str, names: dict[str, Any], local_names: Any = None) -> Any:
    """
    Return the value of a Python expression in which only `names` are known.

    Raises:
        DescriptionError: it uses what leads out of the expression.
        Exception: whatever Python says about the expression.
    """
    code = _compile(text.strip())
    dict.__setitem__(names, '__builtins__', {ATTRIBUTE: _attribute})  # past xacro's own table
    return eval(code, names, local_names)


@lru_cache(maxsize=1024)
def _compile(text: str) -> CodeType:
    tree = ast.parse(text, '<expression>', 'eval')
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id.startswith('__'):
            raise _refused(node.id)
        if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load):
            raise _refused(node.attr)
    return compile(ast.fix_missing_locations(_Guarded().visit(tree)), '<expression>', 'eval')


class _Guarded(ast.NodeTransformer):
    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:  # noqa: N802
        """Replace `a.b` by `__attribute(a, 'b')`."""
        self.generic_visit(node)
        function = ast.Name(ATTRIBUTE, ast.Load())
        return ast.Call(function, [node.value, ast.Constant(node.attr)], [])


def _attribute(value: Any, name: str) -> Any:
    """
    Return an attribute of a plain value, or of a type of them.

    Functions, generators and classes have attributes that lead into the interpreter, and so have
    the fields of a format.
    """
    is_type = any(value is kind for kind in VALUES)
    is_formatted = name in FORMATS
    is_key = isinstance(value, dict) and name in value and not name.startswith('__')
    if (name.startswith('_') and not is_key) or not (is_type or isinstance(value, VALUES)):
        raise _refused(name)
    if is_formatted and is_type:
        raise _refused(name)
    if is_formatted and isinstance(value, str):
        return _Formatter(value).call if name == 'format' else _Formatter(value).call_map
    return getattr(value, name)


class _Formatter(string.Formatter):
    """`str.format` whose fields name values and their items, but no attributes."""

    def __init__(self, template: str) -> None:
        self._template = template

    def call(self, *arguments: Any, **named: Any) -> str:
        return self.vformat(self._template, arguments, named)

    def call_map(self, named: Mapping[str, Any]) -> str:
        return self.vformat(self._template, (), named)

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        if '.' in field_name:
            raise _refused(field_name)
        return super().get_field(field_name, args, kwargs)


def _refused(name: str) -> DescriptionError:
    return DescriptionError(f'{name!r} cannot be used in an expression')


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
                os.close(reader)  # else its answer would wait for itself to be read
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
    if status in (
        0,
        -signal.SIGKILL,
        -signal.SIGALRM,
    ):  # it may have ended before we gave up on it
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

    ends = (signal.SIGPROF, signal.SIGALRM)
    for end in ends:
        signal.signal(end, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ends)
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    for limit, wanted in (
        (resource.RLIMIT_AS, pages * resource.getpagesize() + MEMORY),
        (resource.RLIMIT_CORE, 0),
    ):
        most = resource.getrlimit(limit)[1]
        soft = wanted if most == resource.RLIM_INFINITY else min(wanted, most)
        resource.setrlimit(limit, (soft, most))
    signal.setitimer(signal.ITIMER_PROF, CPU)
    signal.alarm(math.ceil(WALL))  # by itself, where nobody is left who would end it


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
