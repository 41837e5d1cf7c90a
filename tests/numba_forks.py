# SPDX-License-Identifier: Apache-2.0
"""
Processes that have loaded numba, and what it compiles with, and nothing of ours.

To load that takes a new Python a second or two of a processor, to compile a small function a tenth
of one. So one Python loads it, and forks for each piece of code.
"""

import atexit
import functools
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import traceback
from typing import Any


def run_forked(
    code: str, folder: Path, environment: dict[str, str]
) -> 'subprocess.CompletedProcess[str]':
    """Run code as a new Python does, `python -c`, in a folder; return what it has said."""
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    request = {'code': code, 'folder': str(folder), 'environment': environment}
    server.stdin.write(json.dumps(request) + '\n')
    server.stdin.flush()
    answer = json.loads(server.stdout.readline())
    return subprocess.CompletedProcess(code, answer['status'], answer['said'], answer['errors'])


@functools.cache
def _server() -> 'subprocess.Popen[str]':
    pipe = subprocess.PIPE
    server = subprocess.Popen([sys.executable, __file__], stdin=pipe, stdout=pipe, text=True)
    atexit.register(server.kill)
    return server


def serve(requests: Any, answers: Any) -> None:
    """Run the code of each line in a fork, and answer by a line."""
    import numba

    numba.njit(lambda x: x + 1)(1)
    for line in requests:
        with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as errors:
            child = os.fork()
            if child == 0:
                os.dup2(said.fileno(), 1)
                os.dup2(errors.fileno(), 2)
                _be_child(**json.loads(line))
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            heard = {}
            for name, file in (('said', said), ('errors', errors)):
                file.seek(0)
                heard[name] = file.read().decode(errors='replace')
        answers.write(json.dumps({'status': status, **heard}) + '\n')
        answers.flush()


def _be_child(code: str, folder: str, environment: dict[str, str]) -> None:
    status = 1
    try:
        os.environ.clear()
        os.environ.update(environment)
        sys.dont_write_bytecode = bool(environment.get('PYTHONDONTWRITEBYTECODE'))
        os.chdir(folder)
        sys.path[0] = ''
        exec(code, {'__name__': '__main__'})
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


if __name__ == '__main__':
    # Its own descriptors: 0, 1 and 2 belong to the forks.
    serve(os.fdopen(os.dup(0)), os.fdopen(os.dup(1), 'w'))
