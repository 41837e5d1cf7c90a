# SPDX-License-Identifier: Apache-2.0
"""The surroundings of a run on ROS: its domain, a recording, a server."""

from collections.abc import Iterator, Sequence
import contextlib
import os
import sys
from typing import TYPE_CHECKING

import rclpy
from teleop_keyboard.key_reader import KeyReader
from wasd_core.errors import attempt_all
from wasd_core.network import claim_domain, namespaces_of, RANGE
from wasd_core.node import explain_ros_errors, init_ros

from wasd_bringup.robots import BOTH
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import NAMESPACED, RunOptions
from wasd_bringup.run.run import Run

if TYPE_CHECKING:
    from wasd_bringup.ros.foxglove import FoxgloveServer
    from wasd_bringup.tools.recording.recorder import BagRecorder


class RosHome:
    """Makes one run on ROS, with its recording and its server, and closes these after it."""

    def __init__(self, ros_arguments: Sequence[str]) -> None:
        self._ros_arguments = ros_arguments
        self._recorder: BagRecorder | None = None
        self._foxglove: FoxgloveServer | None = None
        self._has_run = False

    def make_run(self, options: RunOptions, reader: KeyReader | None, visuals: bool) -> Run:
        """
        Return the run.

        Raises:
            UserError: an option is wrong; the text says how, in one line.
        """
        init_ros(with_own_frames(self._ros_arguments), is_local=True)
        if options.record is not None:
            from wasd_bringup.tools.recording.reader import describe_run
            from wasd_bringup.tools.recording.recorder import BagRecorder

            description = describe_run(options, self._ros_arguments)
            self._recorder = BagRecorder(options.record, description)
        if options.foxglove is not None:
            from wasd_bringup.ros.foxglove import FoxgloveServer

            self._foxglove = FoxgloveServer(options.foxglove)
        with explain_ros_errors():
            run = make_ros_run(options, reader, visuals, self._recorder, self._foxglove)
        self._has_run = True
        return run

    def close(self) -> None:
        """End everything, also what has begun in part, also after a failure."""
        served = [self._foxglove.close] if self._foxglove is not None else []
        recorded = []
        if self._recorder is not None:
            # If nothing has run, an older recording stays.
            recorded = [self._recorder.close if self._has_run else self._recorder.discard]
        attempt_all(*served, *recorded, rclpy.try_shutdown)


@contextlib.contextmanager
def own_place(options: RunOptions, ros_arguments: Sequence[str]) -> Iterator[None]:
    """
    Context of a run that others may talk to; it changes ROS_DOMAIN_ID where that is unset.

    Says in one line on standard error when the run is not where one would look for it.
    """
    if os.environ.get(RANGE) == 'OFF':  # nobody hears it, wherever it is
        yield
        return
    namespaces = namespaces_of(ros_arguments)
    if options.robot == BOTH:  # /clock and /tf are those of the root
        namespaces += [f'/{robot.namespace}' for robot in options.per_robot()]
    place, words = claim_domain(os.environ, namespaces, './wasd topics')
    if words:
        print(f'wasd: {words}', file=sys.stderr, flush=True)
    with place or contextlib.nullcontext():
        yield


def with_own_frames(ros_arguments: Sequence[str]) -> list[str]:
    """
    Return ROS arguments in which a namespace has a clock and a tree of frames of its own.

    A rule of the user's for /clock, /tf or /tf_static comes first, so it holds.
    """
    words = list(ros_arguments)
    if namespaces_of(words) == ['/']:
        return words
    if '--' in words:
        words = words[: words.index('--')]
    rules = [word for name, own in NAMESPACED for word in ('-r', f'{name}:={own}')]
    return [*words, *rules]
