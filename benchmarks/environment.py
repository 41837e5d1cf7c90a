# SPDX-License-Identifier: Apache-2.0
"""Environments of the processes that a benchmark starts: who of them hears whom over ROS."""

import os
import random


def alone() -> dict[str, str]:
    """Return the environment of a process that talks to no other: runs go side by side."""
    return {**_without_range(), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'}


def together(turn: int | None = None) -> dict[str, str]:
    """
    Return one for processes that hear each other and nobody else: a domain of their own.

    Groups of processes that run side by side say whose `turn` it is: none shares a domain.
    """
    begin, _, end = os.environ.get('WASD_TEST_DOMAINS', '1-100').partition('-')
    first, last = int(begin), int(end or begin)
    if turn is None:
        domain = random.SystemRandom().randint(first, last)
    else:
        domain = first + turn % (last + 1 - first)
    return {
        **_without_range(),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(domain),
    }


def _without_range() -> dict[str, str]:
    # Where this one is set, it goes before the other.
    return {name: value for name, value in os.environ.items() if name != 'ROS_LOCALHOST_ONLY'}
