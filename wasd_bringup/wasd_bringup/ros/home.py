# SPDX-License-Identifier: Apache-2.0
"""The surroundings of a run on ROS: its domain, a recording, a server."""

from collections.abc import Callable, Iterator, Sequence
import contextlib
import os
import sys

import rclpy
from teleop_keyboard.key_reader import KeyReader
from wasd_core.network import claim_domain, namespaces_of, RANGE
from wasd_core.node import explain_ros_errors, init_ros

from wasd_bringup.robots import BOTH
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import NAMESPACED, RunOptions
from wasd_bringup.run.run import Run


def make_public_run(
    ros_arguments: Sequence[str],
    options: RunOptions,
    reader: KeyReader | None,
    visuals: bool,
    ends: list[Callable[[], object]],
) -> Run:
    """
    Return a run on ROS, with its recording and its server; `ends` are given what ends it all.

    Raises:
        UserError: an option is wrong; the text says how, in one line.
    """
    ends.append(rclpy.try_shutdown)
    init_ros(with_own_frames(ros_arguments), is_local=True)
    recorder = None
    foxglove = None
    if options.record is not None:
        from wasd_bringup.tools.recording.reader import describe_run
        from wasd_bringup.tools.recording.recorder import BagRecorder

        recorder = BagRecorder(options.record, describe_run(options, ros_arguments))
        ends.insert(0, recorder.discard)  # if nothing has run, an older recording stays
    if options.foxglove is not None:
        from wasd_bringup.ros.foxglove import FoxgloveServer

        foxglove = FoxgloveServer(options.foxglove)
        ends.insert(0, foxglove.shut_down)
    with explain_ros_errors():
        run = make_ros_run(options, reader, visuals, recorder, foxglove)
    if recorder is not None:
        ends[ends.index(recorder.discard)] = recorder.close
    ends.insert(0, run.close)
    return run


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
