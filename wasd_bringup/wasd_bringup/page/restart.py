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

from wasd_bringup.cli.parsers import called, split_ros_arguments
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


def choices_of(options: RunOptions) -> Start:
    """Return what a run, by its options, may start again with."""
    words, for_ros = split_ros_arguments(options.words)
    return Start(
        called(),
        (*ROBOTS, BOTH),
        options.robot,
        # A file of the user's is a world, too.
        WORLDS if options.world in WORLDS else (*WORLDS, options.world),
        options.world,
        shlex.join((*kept_words(words), *for_ros)),
        refusal(options),
    )


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
    own, for_ros = split_ros_arguments(words) if words[0] == robot else ([], [])
    page = '--viewer', 'web', '--port', port, '--no-open'
    return (robot, *kept_words(own), '--world', world, *page, *for_ros)


def kept_words(words: Sequence[str]) -> list[str]:
    """Return the options that a robot keeps as its run starts again; none is for ROS."""
    kept, rest = [], iter(words[1:])
    for word in rest:
        if word in _WITH_VALUE:
            next(rest, None)
        elif word not in _ALONE and word.partition('=')[0] not in _WITH_VALUE:
            kept.append(word)
    return kept


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
