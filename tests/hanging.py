# SPDX-License-Identifier: Apache-2.0
"""
Ends a process of the tests that hangs, and shows where it did.

Nothing in Python ends a wait in a library that holds Python's lock, and a worker that hangs keeps
the whole run from its end. So a thread of C looks at the time: it writes what each thread does,
and ends the process. What shared the tests among workers then names the test, and ends what that
worker has started. What it had still to do is not done: the run says so by its status, which is
not that of a failure.
"""

from collections.abc import Iterator
import contextlib
import faulthandler
import os
from pathlib import Path
import signal
from typing import Any

import pytest

# A test takes seconds, and up to 30 times as long where 14 processes share two processors [s].
LIMIT = 600.0

_stderr = pytest.StashKey[int]()
_has_lost = pytest.StashKey[bool]()


def pytest_configure(config: pytest.Config) -> None:
    """Declare the mark, and keep standard error: that of a running test is kept from view."""
    line = 'takes_up_to(seconds): may take longer than others before it counts as hanging'
    config.addinivalue_line('markers', line)
    config.stash[_stderr] = os.dup(2)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[Any]:
    """Watch a test with its fixtures."""
    mark = item.get_closest_marker('takes_up_to')
    usual = max(LIMIT, *mark.args) if mark else LIMIT
    limit = float(os.environ.get('WASD_TEST_LIMIT', usual))
    faulthandler.dump_traceback_later(limit, exit=True, file=item.config.stash[_stderr])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Note that a worker was lost; end its children, which would stay in their ROS domains."""
    if error:
        node.config.stash[_has_lost] = True
        worker, run = (node.workerinput[name] for name in ('workerid', 'testrunuid'))
        # They have inherited these, unless a test took away their whole environment.
        marks = {f'PYTEST_XDIST_WORKER={worker}', f'PYTEST_XDIST_TESTRUNUID={run}'}
        for folder in Path('/proc').glob('[0-9]*'):
            with contextlib.suppress(OSError):  # it has ended, or is somebody else's
                if marks <= set((folder / 'environ').read_text(errors='replace').split('\0')):
                    os.kill(int(folder.name), signal.SIGKILL)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tell a run in which nobody looked at some tests from one in which some failed."""
    if session.config.stash.get(_has_lost, False):
        session.exitstatus = pytest.ExitCode.INTERNAL_ERROR
