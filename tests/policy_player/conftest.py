# SPDX-License-Identifier: Apache-2.0
"""
Looks at networks without a start of Python for each.

A look is a process of its own. Here it is the fork of one that has loaded the runtime already: it
does all that `first_look.main` does, within the same bounds, and may crash as that one may. Looks
of processes that tests start are as everywhere.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

# Whose tests are of that look: no file is known to them by its bytes.
LOOKERS = ('test_strangers_files', 'test_ours')
# For each line, the name of a file: the line that a look at it prints, and its status.
FORKS = """
import os, sys
import numpy, onnxruntime
from policy_player import first_look
for line in sys.stdin:
    out, into = os.pipe()
    child = os.fork()
    if not child:
        os.dup2(into, 1)
        sys.argv[1:] = [line[:-1]]
        first_look.main()
        sys.stdout.flush()
        os._exit(0)
    os.close(into)
    with open(out) as file:
        told = ''.join(file.read().splitlines()[-1:])
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(told, status, sep='\\n', flush=True)
"""
_found: dict[bytes, dict[str, Any]] = {}


@pytest.fixture(scope='session')
def fork_of_a_look() -> Iterator[Callable[..., Any]]:
    """Return what takes the place of `subprocess.run` for looks."""
    process = None

    def run(words: list[str], **_: Any) -> Any:
        nonlocal process
        if process is None:
            command = [sys.executable, '-c', FORKS]
            pipe = subprocess.PIPE
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        process.stdin.write(f'{words[-1]}\n')
        process.stdin.flush()
        told, status = process.stdout.readline(), process.stdout.readline()
        return SimpleNamespace(stdout=told.encode(), returncode=int(status))

    yield run
    if process is not None:
        process.communicate()


@pytest.fixture(autouse=True)
def looks(
    request: pytest.FixtureRequest,
    fork_of_a_look: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Look at files of equal bytes once; where a look is the thing, at each, by a fork."""
    from policy_player import first_look

    forks = SimpleNamespace(
        run=fork_of_a_look, DEVNULL=subprocess.DEVNULL, TimeoutExpired=subprocess.TimeoutExpired
    )
    monkeypatch.setattr(first_look, 'subprocess', forks)
    if request.path.stem in LOOKERS:
        return
    look = first_look.look

    def look_once(path: Path) -> dict[str, Any]:
        data = path.read_bytes()
        if data not in _found:
            _found[data] = look(path)
        return _found[data]

    monkeypatch.setattr(first_look, 'look', look_once)
