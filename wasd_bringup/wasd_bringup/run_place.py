# SPDX-License-Identifier: Apache-2.0
"""Where in ROS a run is: a domain that no other run on this machine drives in."""

from collections.abc import Iterator, Sequence
import contextlib
import os
import sys

from wasd_core.network import claim_domain
from wasd_core.network import namespaces_of
from wasd_core.network import RANGE

from wasd_bringup.options import RunOptions

# What a namespace keeps apart, too: a robot alone in its world has its own time and frames.
NAMESPACED = (('/clock', 'clock'), ('/tf', 'tf'), ('/tf_static', 'tf_static'))


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
    if options.robot == 'both':  # /clock and /tf are those of the root
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
