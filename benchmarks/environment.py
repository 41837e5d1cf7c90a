# SPDX-License-Identifier: Apache-2.0
"""Environments of the processes that a benchmark starts: who of them hears whom over ROS."""

import os
import random


def alone() -> dict[str, str]:
    """Return the environment of a process that talks to no other: runs go side by side."""
    return {**_without_range(), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'}


def together() -> dict[str, str]:
    """Return one for processes that hear each other and nobody else: a domain of their own."""
    first, _, last = os.environ.get('WASD_TEST_DOMAINS', '1-100').partition('-')
    domain = random.SystemRandom().randint(int(first), int(last or first))
    return {
        **_without_range(),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(domain),
    }


def _without_range() -> dict[str, str]:
    # Where this one is set, it goes before the other.
    return {name: value for name, value in os.environ.items() if name != 'ROS_LOCALHOST_ONLY'}
