# SPDX-License-Identifier: Apache-2.0
"""Who may talk to our nodes: this machine only, unless the user says otherwise."""

from collections.abc import MutableMapping
from pathlib import Path

# Fast DDS with every socket on 127.0.0.1. ROS' own LOCALHOST only stops the search: its sockets
# are open to any host that names this one.
PROFILE = Path(__file__).with_name('profiles') / 'this_machine.xml'
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PROFILES_FILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
# Whoever has set one of these has said who may talk to whom.
SAYS_WHO = (RANGE, 'ROS_LOCALHOST_ONLY')
# With these others are asked for by name: what they say must get through.
SAYS_HOW = (PROFILES_FILE, 'ROS_STATIC_PEERS', 'ROS_DISCOVERY_SERVER')
# Fast DDS reads a file of this name in the current folder.
USERS_PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml'


def is_sourced(environment: MutableMapping[str, str]) -> bool:
    """Return whether a ROS has been sourced, whose customs then hold for single nodes."""
    return bool(environment.get('ROS_DISTRO'))


def keep_to_this_machine(
    environment: MutableMapping[str, str], middleware: str, folder: Path = Path()
) -> None:
    """
    Change an environment so that ROS in it talks to this machine only.

    What the user has set stays as it is. `middleware` is the RMW's name: only Fast DDS can be
    bound to the machine from here; any other is told not to look further (LOCALHOST). `folder`
    is the current one.
    """
    if any(environment.get(name) for name in SAYS_WHO):
        return
    has_own = any(environment.get(name) for name in SAYS_HOW) or (folder / USERS_PROFILES).exists()
    if has_own or not middleware.startswith('rmw_fastrtps'):
        environment[RANGE] = 'LOCALHOST'
        return
    # All is in the profile; LOCALHOST would add a transport that listens everywhere.
    environment[RANGE] = 'SYSTEM_DEFAULT'
    environment[PROFILES_FILE] = str(PROFILE)
