# SPDX-License-Identifier: Apache-2.0
"""
colcon, that starts Python for our packages once each, and not four times.

Before it builds a package colcon asks its setup.py for the commands and options that setuptools
has, which are the same for all packages, and for its facts. Here the first answer holds for all,
and forks of this process, which has setuptools, tell the facts.
"""

import asyncio
from collections.abc import Callable
import functools
import os
import subprocess
import sys
import tempfile
import traceback
from typing import Any

from colcon_core.command import main
from colcon_core.task.python.build import PythonBuildTask
from colcon_python_setup_py.package_identification import python_setup_py
import setuptools  # noqa: F401


def asked_once(ask: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method that asks of the first package what is the same for all."""
    answers: dict[Any, Any] = {}

    @functools.wraps(ask)
    async def ask_once(task: Any, path: Any, environment: Any, *words: str) -> Any:
        if words not in answers:
            answers[words] = asyncio.ensure_future(ask(task, path, environment, *words))
        return await answers[words]

    return ask_once


class Forks:
    """What stands for `subprocess` where code is run by a Python of its own."""

    PIPE = subprocess.PIPE

    @staticmethod
    def run(command: list[str], *, cwd: str, env: Any, **_: Any) -> Any:
        """Run `python -c CODE` in a fork of this process."""
        with tempfile.TemporaryFile() as said:
            child = os.fork()
            if child == 0:
                status = 1
                try:
                    os.dup2(said.fileno(), 1)
                    os.chdir(cwd)
                    os.environ.clear()
                    os.environ.update(env)
                    exec(command[-1], {})
                    sys.stdout.flush()
                    status = 0
                except BaseException:
                    traceback.print_exc()
                finally:
                    os._exit(status)
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            said.seek(0)
            done = subprocess.CompletedProcess(command, status, said.read())
        done.check_returncode()
        return done


for name in ('_get_available_commands', '_get_available_options'):
    setattr(PythonBuildTask, name, asked_once(getattr(PythonBuildTask, name)))
python_setup_py.subprocess = Forks
sys.exit(main())
