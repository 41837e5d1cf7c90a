# SPDX-License-Identifier: Apache-2.0
"""
A small process in which xacro files are expanded for tests.

Each expansion is a fork that is thrown away: 8 ms of a processor in a process that has loaded
xacro alone, and eight times that in one that has loaded all that tests load, a thousand times in
a run. What is done in the fork, and its bounds, are those of `robot_description.xacro.sandbox`.

A test that has changed anything of Python's by `monkeypatch`, and those of TESTS_OF_IT, expand in
their own process, as programs do.
"""

import atexit
from collections.abc import Mapping
import json
import os
import signal
import socket
import sys
import threading
from typing import Any

import pytest

# Whose subject is where and how expansions are done.
TESTS_OF_IT = ('test_bounded', 'test_expressions')
LENGTH = 8  # of a number that says how long what follows is [B]


class SmallExpander:
    """Stands in for `run_bounded`; to be made before anything large is loaded."""

    def __init__(self) -> None:
        # Here, so that nothing else is loaded before.
        import robot_description.xacro as user
        from robot_description.xacro import sandbox

        self._user: Any = user
        self._run_bounded, self._process = sandbox.run_bounded, user.process
        self._path: list[str] | None = None
        self._patches: Any = None
        self._owner, self._lock = os.getpid(), threading.Lock()
        self._link, theirs = socket.socketpair()
        self._child = os.fork()
        if self._child == 0:
            self._link.close()
            try:
                self._serve(theirs)
            finally:
                os._exit(0)
        theirs.close()
        atexit.register(self._end)

    def take_place(self) -> None:
        """Expand what is expanded from now on, in this process."""
        self._path = list(sys.path)
        self._user.run_bounded = self._ask

    def attend(self, test: str, patches: Any) -> None:
        """Take a test, by the name of its file, and its `monkeypatch`."""
        self._patches = None if test in TESTS_OF_IT else patches

    def _ask(self, work: Any, job: Mapping[str, Any]) -> Any:
        is_usual = self._patches is not None and not self._patches._setattr
        is_usual &= work is self._process and sys.path == self._path
        if not is_usual or os.getpid() != self._owner or not self._lock.acquire(blocking=False):
            return self._run_bounded(work, job)
        request = {'job': job, 'folder': os.getcwd(), 'environment': dict(os.environ)}
        try:
            _send(self._link, request)
            answer = _receive(self._link)
        finally:
            self._lock.release()
        if 'failure' in answer:
            from robot_description.xacro.sandbox import OutOfBounds

            raise OutOfBounds(*answer['failure'])
        return answer['answer']

    def _serve(self, link: socket.socket) -> None:
        """Do what is asked for, until nobody is there who asks."""
        from robot_description.xacro.sandbox import OutOfBounds

        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends with those who ask
        while request := _receive(link):
            os.chdir(request['folder'])
            os.environ.clear()
            os.environ.update(request['environment'])
            try:
                answer = {'answer': self._run_bounded(self._process, request['job'])}
            except OutOfBounds as error:
                answer = {'failure': [str(error), error.note]}
            _send(link, answer)

    def _end(self) -> None:
        if os.getpid() == self._owner:
            self._link.close()
            os.waitpid(self._child, 0)


def _send(link: socket.socket, what: Any) -> None:
    data = json.dumps(what).encode()
    link.sendall(len(data).to_bytes(LENGTH, 'big') + data)


def _receive(link: socket.socket) -> Any:
    """Return what was sent; None at the end."""
    with link.makefile('rb') as stream:
        length = stream.read(LENGTH)
        return json.loads(stream.read(int.from_bytes(length, 'big'))) if length else None


EXPANDER = SmallExpander() if sys.platform == 'linux' else None


def pytest_collection_finish() -> None:
    """Have what tests expand expanded there."""
    if EXPANDER:
        EXPANDER.take_place()


@pytest.fixture(autouse=True)
def _attended(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Know which test it is, and what it has changed."""
    if EXPANDER:
        EXPANDER.attend(request.path.stem, monkeypatch)
