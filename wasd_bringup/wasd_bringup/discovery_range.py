# SPDX-License-Identifier: Apache-2.0
"""How far ROS looks for others: not at all, on this machine, or in the network around it."""

import os

from wasd_core.network import RANGE
from wasd_core.network import SAYS_WHO

# Values of --discovery; rcl knows them in capitals.
RANGES = ('off', 'localhost', 'subnet')


def keep_alone() -> None:
    """
    Have what is initialised next talk to no other process, whatever the environment says.

    An experiment is to be repeated: not even another run on this machine may join it.
    """
    set_range('off')


def set_range(name: str) -> None:
    """Have what is initialised next look for others in one of RANGES."""
    os.environ[RANGE] = name.upper()
    # The variable of old takes precedence where it is set, and knows no "off".
    os.environ.pop('ROS_LOCALHOST_ONLY', None)


def choose_range(asked: str | None, is_experiment: bool) -> None:
    """
    Set the range of a run: as asked, else off for an experiment, else what the user has set.

    Who has set nothing keeps to this machine, by `init_ros`: a classroom shares a network, and
    nobody is to drive the neighbour's robot by accident. Asked for by name, that holds whatever
    the environment says.
    """
    if asked == 'localhost':
        for name in SAYS_WHO:
            os.environ.pop(name, None)
    elif asked is not None:
        set_range(asked)
    elif is_experiment:
        keep_alone()
