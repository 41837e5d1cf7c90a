# SPDX-License-Identifier: Apache-2.0
"""
ROS domains of the runs on this machine.

ROS keeps to this machine unless the user says otherwise. Each run takes a domain of its own by
binding sockets with names (abstract unix sockets): the kernel gives a name once, to one process,
and takes it back when that ends, however it ends. Such names hold for the same network namespace
as 127.0.0.1 does, for all users. Anybody may take a name; whose socket it is the kernel says.
"""

from collections.abc import MutableMapping, Sequence
import contextlib
import hashlib
import os
from pathlib import Path
import re
import socket
import struct
import sys
import threading
from typing import NamedTuple, Self

from wasd_core.errors import UserError

# Of this machine, reached from no other.
LOOPBACK = '127.0.0.1'
FAST_DDS = 'rmw_fastrtps'
MIDDLEWARE = 'RMW_IMPLEMENTATION'
# Where ament registers each, in a prefix.
MIDDLEWARES = 'share/ament_index/resource_index/rmw_typesupport_cpp'
# Fast DDS with every socket on 127.0.0.1. ROS' own LOCALHOST only stops the search: its sockets
# are open to any host that names this one.
PROFILE = Path(__file__).with_name('profiles') / 'this_machine.xml'
# The same without shared memory.
UDP_PROFILE = PROFILE.with_name('this_machine_udp.xml')
# What Fast DDS uses where no profile says so.
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
# The variable of old, which takes precedence.
LOCALHOST_ONLY = 'ROS_LOCALHOST_ONLY'
PROFILES_FILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
# If the user has set one of these, that decides which machines may talk to each other.
SAYS_WHO = (RANGE, LOCALHOST_ONLY)
# With these others are asked for by name: what they say must get through.
SAYS_HOW = (PROFILES_FILE, 'ROS_STATIC_PEERS', 'ROS_DISCOVERY_SERVER')
# Set to 1, Fast DDS does not read DEFAULT_FASTRTPS_PROFILES.xml in the current folder, by which a
# stranger could have it listen to any host, or write its log over any file.
SKIP_FOLDERS_PROFILES = 'SKIP_DEFAULT_XML_FILE'


def check_middleware(environment: MutableMapping[str, str]) -> None:
    """
    Refuse an RMW that is not installed: with it ROS ends the process as soon as it is loaded.

    Raises:
        UserError: what it is, and what there is.
    """
    wanted = environment.get(MIDDLEWARE)
    prefixes = [sys.prefix, *environment.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    folders = [Path(prefix) / MIDDLEWARES for prefix in filter(None, prefixes)]
    known = {path.name for folder in folders if folder.is_dir() for path in folder.iterdir()}
    known.discard('rmw_implementation')  # it stands for any
    if wanted and known and wanted not in known:
        there = ', '.join(sorted(known))
        raise UserError(f'{MIDDLEWARE}: {wanted!r} is not installed (there: {there})')


def is_sourced(environment: MutableMapping[str, str]) -> bool:
    """Return whether a ROS has been sourced, whose customs then hold for single nodes."""
    return bool(environment.get('ROS_DISTRO'))


def keep_to_this_machine(environment: MutableMapping[str, str], middleware: str) -> None:
    """
    Change an environment so that ROS in it talks to this machine only.

    What the user has set stays as it is. `middleware` is the RMW's name: only Fast DDS can be
    bound to the machine from here; any other is told not to look further (LOCALHOST).
    """
    if any(environment.get(name) for name in SAYS_WHO):
        return
    has_own = any(environment.get(name) for name in SAYS_HOW)
    if has_own or not middleware.startswith(FAST_DDS):
        environment[RANGE] = 'LOCALHOST'
        return
    # All is in the profile; LOCALHOST would add a transport that listens everywhere.
    environment[RANGE] = 'SYSTEM_DEFAULT'
    environment[PROFILES_FILE] = str(PROFILE)


def set_range(environment: MutableMapping[str, str], name: str) -> None:
    """Set in which range ROS looks for others; `off` is a run with which nobody talks."""
    environment[RANGE] = name.upper()
    # The variable of old takes precedence where it is set, and knows no "off".
    environment.pop(LOCALHOST_ONLY, None)


def do_without_shared_memory(environment: MutableMapping[str, str]) -> None:
    """
    Make Fast DDS use only UDP.

    Under LOCALHOST rmw_fastrtps itself adds shared memory, so our profile takes its place, which
    knows no peers on other machines.
    """
    is_local = environment.get(RANGE) == 'LOCALHOST' or environment.get(LOCALHOST_ONLY) == '1'
    if is_local or environment.get(PROFILES_FILE) == str(PROFILE):
        set_range(environment, 'SYSTEM_DEFAULT')
        environment[PROFILES_FILE] = str(UDP_PROFILE)
    elif not environment.get(TRANSPORTS):
        environment[TRANSPORTS] = 'UDPv4'


def domain_of(environment: MutableMapping[str, str]) -> int:
    """
    Return the domain that an environment names; 0 where it names none.

    Raises:
        UserError: it names what is none.
    """
    said = environment.get(DOMAIN) or '0'
    if not re.fullmatch(r'\d{1,3}', said, re.ASCII) or int(said) > LAST_DOMAIN:
        raise UserError(f'{DOMAIN}: got {said[:SHOWN_LENGTH]!r}, wanted 0 to {LAST_DOMAIN}')
    return int(said)


# Higher ones have ports among those that any program may be given.
DOMAINS = range(102)
LAST_DOMAIN = 232  # for which RTPS has ports
DOMAIN = 'ROS_DOMAIN_ID'
SOCKETS = Path('/proc/net/unix')
# One that is listened at tells who does: process, user, group.
RUN_SOCKET, CREDENTIALS = socket.SOCK_STREAM, 'iII'
PROCESSES = Path('/proc')
# How much of a command line is shown.
SHOWN_LENGTH = 40


class Run(NamedTuple):
    """A run of this machine: its domain, its user, its process."""

    domain: int
    user: int
    process: int

    @property
    def name(self) -> str:
        """What its socket is called."""
        return f'wasd run {self.domain} {self.user} {self.process}'

    @property
    def is_true(self) -> bool:
        """Whether that user's process has made the socket: the kernel knows, not the name."""
        with socket.socket(socket.AF_UNIX, RUN_SOCKET) as asker:
            asker.setblocking(False)  # somebody else's may let us wait
            try:
                asker.connect(f'\0{self.name}')
            except OSError:
                return False
            size = struct.calcsize(CREDENTIALS)
            peer = asker.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
        process, user, _ = struct.unpack(CREDENTIALS, peer)
        return (process, user) == (self.process, self.user)

    @property
    def is_suspended(self) -> bool:
        """Whether its process is stopped, as by Ctrl-Z: it answers nobody."""
        try:
            said = (PROCESSES / str(self.process) / 'stat').read_text(errors='replace')
        except OSError:  # it has ended meanwhile
            return False
        return said.rpartition(')')[2].split()[0] == 'T'

    @property
    def words(self) -> str:
        """What was started, e.g. `wasd go2`."""
        try:
            line = (PROCESSES / str(self.process) / 'cmdline').read_bytes()
        except OSError:  # it has ended meanwhile
            return 'wasd'
        words = line.decode(errors='replace').rstrip('\0').split('\0')
        start = next((i for i, word in enumerate(words) if 'wasd' in Path(word).name), 0)
        shown = ' '.join(['wasd', *words[start + 1 :]])[:SHOWN_LENGTH]
        return ''.join(c if c.isprintable() else '?' for c in shown)

    def __str__(self) -> str:
        """Return how it is called in a line for the user."""
        return f'{self.words} (process {self.process})'


class Claim:
    """A run's place, held until `close` or until the process ends."""

    def __init__(self, domain: int, sockets: Sequence[socket.socket]) -> None:
        self.domain = domain
        self._sockets = sockets
        self._listener: threading.Thread | None = None

    def __enter__(self) -> Self:
        """Hold the place."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give it back."""
        self.close()

    def listen(self) -> None:
        """Let callers connect, who learn whose place it is."""
        self._sockets[-1].listen()
        waiting = (self._sockets[-1],)
        self._listener = threading.Thread(target=_dismiss_callers, args=waiting, daemon=True)
        self._listener.start()

    def close(self) -> None:
        """Give the place back: the next run that asks gets it."""
        for one in self._sockets:
            with contextlib.suppress(OSError):  # not connected
                one.shutdown(socket.SHUT_RDWR)  # which ends a thread that waits at it
            one.close()
        if self._listener is not None:  # until it has left, the system keeps the name
            self._listener.join(1.0)


def claim(domain: int, namespaces: Sequence[str]) -> Claim | None:
    """
    Take namespaces of a domain for this process; None when another has one of them.

    Two runs in one domain do not hear each other when their namespaces differ.
    """
    sockets: list[socket.socket] = []
    place = Claim(domain, sockets)
    names = [f'wasd place {domain} {_short(namespace)}' for namespace in namespaces]
    run = Run(domain, os.getuid(), os.getpid())
    for name, kind in [*((name, socket.SOCK_DGRAM) for name in names), (run.name, RUN_SOCKET)]:
        bound = _bind(name, kind)
        if bound is None:
            place.close()
            return None
        sockets.append(bound)
    place.listen()
    return place


def _dismiss_callers(listener: socket.socket) -> None:
    """Let go who connects only to learn whose socket it is, until it is closed."""
    with contextlib.suppress(OSError):
        while True:
            listener.accept()[0].close()


def claim_domain(
    environment: MutableMapping[str, str], namespaces: Sequence[str], talk: str
) -> tuple[Claim | None, str]:
    """
    Give a run a ROS domain in which nobody on this machine drives its robot; set it.

    Returns the place, and a line for the user when something is not as usual: another domain than
    0, or one of the user's own that another run is in, too. `talk` is a command that would reach
    this run. If other processes hold every domain, the run talks to nobody.
    """
    if environment.get(DOMAIN):
        named = environment[DOMAIN]
        wanted = int(named) if named.isdecimal() else domain_of(environment)  # which refuses it
        place = claim(wanted, namespaces)
        if place is not None:
            return place, ''
        return None, (
            f'domain {wanted} has {_other_run(wanted)}, too: each may get keys and '
            'commands for the other'
        )
    for domain in DOMAINS:
        place = claim(domain, namespaces)
        if place is None:
            continue
        environment[DOMAIN] = str(domain)
        if domain == DOMAINS[0]:
            return place, ''
        return place, (
            f'domain {DOMAINS[0]} has {_other_run(DOMAINS[0])}: this one is in domain {domain} '
            f'(to talk to it: {DOMAIN}={domain} {talk})'
        )
    set_range(environment, 'off')
    return None, f'every domain is taken: this run talks to nobody ({DOMAIN}=N shares one)'


def _other_run(domain: int) -> str:
    runs = [run for run in running() if run.domain == domain]
    return f'another run, {runs[0]}' if runs else 'another run'


def running(user: int | None = None) -> list[Run]:
    """Return the runs of this machine, or a user's, by domain; none where that cannot be read."""
    try:
        text = SOCKETS.read_text(errors='replace')
    except OSError:
        return []
    found = re.findall(r'@wasd run (\d+) (\d+) (\d+)$', text, re.MULTILINE)
    runs = sorted({Run(*map(int, numbers)) for numbers in found})
    return [run for run in runs if user in (None, run.user) and run.is_true]


def join_domain(environment: MutableMapping[str, str]) -> str:
    """
    Choose the domain of a command that talks to a run, where the user has not; set it.

    It is that of the user's one run, the lowest when there are several, 0 when there is none.
    Returns a line for the user when there was a choice.
    """
    if environment.get(DOMAIN):
        return ''
    runs = running(os.getuid())
    if not runs:
        return ''
    environment[DOMAIN] = str(runs[0].domain)
    others = [run for run in runs if run.domain != runs[0].domain]
    if not others:
        return ''
    those = ', '.join(f'{DOMAIN}={run.domain} for {run}' for run in others)
    return f'using {runs[0]} in domain {runs[0].domain}; for others set {those}'


def namespaces_of(ros_arguments: Sequence[str]) -> list[str]:
    """Return the namespaces that ROS arguments give to nodes; the root when they give none."""
    said = [word.partition(':=') for word in ros_arguments]
    found = [value for name, _, value in said if name.rpartition(':')[2] == '__ns']
    return sorted({f'/{name.strip("/")}' for name in found}) or ['/']


def _bind(name: str, kind: int) -> socket.socket | None:
    bound = socket.socket(socket.AF_UNIX, kind)
    try:
        bound.bind('\0' + name)
    except OSError:
        bound.close()
        return None
    return bound


def _short(namespace: str) -> str:
    """Return a name that fits into an address, the same for the same namespace."""
    if len(namespace) <= SHOWN_LENGTH:
        return namespace
    return hashlib.sha256(namespace.encode()).hexdigest()[:SHOWN_LENGTH]
