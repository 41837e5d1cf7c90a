# SPDX-License-Identifier: Apache-2.0
"""Opens the wire that programs of the SDK are at, where what it needs is installed."""

from collections.abc import Iterable
import importlib.util

from wasd_core.errors import UserError
from wasd_core.extras import install_line

from unitree_bridge.loopback import check_loopback
from unitree_bridge.topics import Topic
from unitree_bridge.wire import Wire


def open_wire(domain: int, network: str, out: Iterable[Topic], into: Iterable[Topic]) -> Wire:
    """
    Join a DDS domain on a loopback interface; `out` is published, `into` is taken.

    Raises:
        UserError: Cyclone DDS is not installed, or the network is no loopback.
    """
    check_loopback(network)
    if importlib.util.find_spec('cyclonedds') is None:
        raise UserError(f"Unitree's interface needs: {install_line('unitree')}")
    # Here, because who does not ask for it does without.
    from unitree_bridge.dds import DdsWire

    return DdsWire(domain, network, out, into)
