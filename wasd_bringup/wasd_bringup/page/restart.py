# SPDX-License-Identifier: Apache-2.0
"""
Restarts a run from the page with another robot or world.

A world is compiled into the model that everything holds. So the run ends as it always does, and
its process becomes that of a new one on the same terminal and port, and the page comes back. If
another program takes the port in between, the new run has a page on another.
"""

from collections.abc import Mapping, Sequence
import os
import shlex
import socket
import sys
from typing import NoReturn

from mujoco_sim.scene import WORLDS as PLAIN
from wasd_cockpit.link import Start
from wasd_core.network import LOOPBACK

from wasd_bringup.cli.parsers import called
from wasd_bringup.robots import BOTH, ROBOTS
from wasd_bringup.run.options import RunOptions

# What the page offers: each world there is, where it is of a size at a moderate one.
WORLDS = (
    *(*PLAIN, 'flat:1', 'slope:10', 'stairs:0.1', 'step:0.1', 'boxes:0.05', 'rough:0.05'),
    *('ice:0.2', 'gap:0.15', 'stepping:0.1', 'course:1'),
)
_WITH_VALUE, _ALONE = ('--world', '--port', '--viewer'), ('--no-open',)
# Set for a run that starts again: its port is the one that it had, not one that a user asks for.
_MARK = 'WASD_ANEW'


class Restart:
    """The choices for a restart; `wanted` are the words of the requested one."""

    def __init__(self, options: RunOptions) -> None:
        """Take what the run was started with."""
        self._words = options.words
        self._page = ''
        self.wanted: tuple[str, ...] = ()
        # A file of the user's is a world, too.
        worlds = WORLDS if options.world in WORLDS else (*WORLDS, options.world)
        self.start = Start(
            called(),
            (*ROBOTS, BOTH),
            options.robot,
            worlds,
            options.world,
            shlex.join((*kept_words(self._words), *self._words[_end(self._words) :])),
            refusal(options),
        )

    def is_at(self, page: str) -> None:
        """Take the address of the run's page."""
        self._page = page

    def want(self, robot: str, world: str) -> None:
        """End the run, and start one with another robot or in another world."""
        start = self.start
        if not start.refusal and robot in start.robots and world in start.worlds:
            port = self._page.rpartition(':')[2].strip('/')
            self.wanted = restart_words(self._words, robot, world, port)


def refusal(options: RunOptions) -> str:
    """Return why a run is not to be started again by a click."""
    if not options.words:
        return 'this run was not started by its command'
    if any((options.record, options.report, options.save_keys, options.save_map)):
        return 'this would overwrite the files of this run: end it with Ctrl-C first'
    if options.map or options.goals:
        return 'its map and its goals belong to this world: end it with Ctrl-C first'
    return 'a script drives this run' if options.scripted else ''


def restart_words(words: Sequence[str], robot: str, world: str, port: str) -> tuple[str, ...]:
    """Return words with another robot, whose options are its own, or world, and the same page."""
    is_same = words[0] == robot
    kept, for_ros = (kept_words(words), words[_end(words) :]) if is_same else ((), ())
    page = '--viewer', 'web', '--port', port, '--no-open'
    return (robot, *kept, '--world', world, *page, *for_ros)


def kept_words(words: Sequence[str]) -> tuple[str, ...]:
    """Return the options that a robot keeps as its run starts again."""
    kept, rest = [], iter(words[1 : _end(words)])
    for word in rest:
        if word in _WITH_VALUE:
            next(rest, None)
        elif word not in _ALONE and word.partition('=')[0] not in _WITH_VALUE:
            kept.append(word)
    return tuple(kept)


def _end(words: Sequence[str]) -> int:
    """Return how many words come before those for ROS."""
    return words.index('--ros-args') if '--ros-args' in words else len(words)


def become(words: Sequence[str], environment: Mapping[str, str]) -> NoReturn:
    """Become the process of a new run."""
    print(f'restarting: {called()} {shlex.join(words)}')
    sys.stdout.flush()
    sys.stderr.flush()
    program = (sys.executable, '-P', '-m', 'wasd_bringup.cli', *words)
    os.execve(sys.executable, program, {**environment, _MARK: '1'})


def page_port(port: int) -> int:
    """Return the port to take for a page: any, 0, where the one that it had has gone meanwhile."""
    if _MARK not in os.environ or _is_free(port):
        return port
    print(f'port {port} is taken now: the page has another address')
    return 0


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True
