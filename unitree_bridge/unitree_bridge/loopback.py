# SPDX-License-Identifier: Apache-2.0
"""
Who may talk to us: this machine alone.

Cyclone DDS sends from the interface that it is told, and receives from all: its sockets are bound
to no address. The kernel binds a socket to an interface, too; what comes in by others it then
does not hand over (socket(7), SO_BINDTODEVICE, since Linux 5.7 without privilege).
"""

from collections.abc import Iterable
import contextlib
import fcntl
import os
from pathlib import Path
import socket
import stat
import struct

from wasd_core.errors import UserError

# netdevice(7): the request for an interface's flags, a name and room for them, and one of them.
_ASK_FLAGS, _REQUEST, _LOOPBACK = 0x8913, struct.Struct('16sH14x'), 0x8
_DESCRIPTORS = Path('/proc/self/fd')


def check_loopback(network: str) -> None:
    """
    Refuse an interface that reaches others: a real Go2 may be among them.

    Raises:
        UserError: there is no such interface, or it is no loopback.
    """
    there = sorted(name for _, name in socket.if_nameindex())
    if network not in there:
        raise UserError(
            f'network: got {network!r}, wanted the loopback (there: {", ".join(there)})'
        )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        said = fcntl.ioctl(asker, _ASK_FLAGS, _REQUEST.pack(network.encode(), 0))
    if not _REQUEST.unpack(said)[1] & _LOOPBACK:
        raise UserError(f'network: {network!r} leads off this machine, wanted the loopback, lo')


def open_sockets() -> set[int]:
    """Return the file descriptors of this process that are sockets of IPv4 or IPv6."""
    found = set()
    for descriptor in map(int, os.listdir(_DESCRIPTORS)):
        with contextlib.suppress(OSError):  # it is closed by now
            if not stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                continue
            with socket.socket(fileno=os.dup(descriptor)) as copy:
                if copy.family in (socket.AF_INET, socket.AF_INET6):
                    found.add(descriptor)
    return found


def keep_to(network: str, descriptors: Iterable[int]) -> None:
    """
    Let sockets hear one interface only.

    Raises:
        UserError: the kernel does not allow it.
    """
    for descriptor in descriptors:
        with socket.socket(fileno=os.dup(descriptor)) as copy:
            try:
                copy.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, network.encode())
            except OSError as error:
                raise UserError(
                    f'network: a socket cannot be kept to {network} ({error.strerror}); '
                    'others could command the robot'
                ) from None
