# SPDX-License-Identifier: Apache-2.0
"""A short look into the ROS graph: what is running, found by name, with public rclpy only."""

from collections.abc import Callable, Sequence
import importlib
import os
import re
import time
from typing import Any, Self, TypeVar

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden
from rclpy.validate_full_topic_name import validate_full_topic_name
from wasd_core.errors import suggest, UserError
from wasd_core.network import running
from wasd_core.node import init_ros, MessagePump
from wasd_core.signals import letting_go, StopSignals

from wasd_bringup.cli.parsers import called

# A name does not exist if nothing new has been discovered for so long [s]. Fast DDS
# announces a process that missed the first announcements every 3 s.
PATIENCE = 5.0
# If a run of this domain has not been seen, wait longer, at most so long [s].
LONGEST = 15.0
# A list is complete when nothing new has come for so long, after at least that [s].
QUIET = 0.5
SHORTEST_LOOK = 1.5
POLL_PERIOD = 0.05

Found = TypeVar('Found')


class NotFound(UserError):
    """A topic, service, node or parameter is not there; the text says what is."""


class Interrupted(Exception):
    """The user has had enough."""


class RosGraph:
    """Context with a hidden node of our own; Ctrl-C in it raises Interrupted."""

    def __init__(self) -> None:
        self.stop = StopSignals()

    def __enter__(self) -> Self:
        """Start rclpy; by default only this machine is looked at, and the run that is there."""
        self.stop.__enter__()
        init_ros([], is_local=True, joins=True)
        self.node = Node(
            f'_wasd_{os.getpid()}', enable_rosout=False, start_parameter_services=False
        )
        self._pump = MessagePump()
        self._pump.add_node(self.node)
        return self

    def __exit__(self, *_: object) -> None:
        """Leave nothing running."""
        self._pump.shutdown(timeout_sec=0.0)
        with letting_go():
            self.node.destroy_node()
            rclpy.try_shutdown()
        self.stop.__exit__()

    def spin(self, timeout: float = POLL_PERIOD) -> None:
        """
        Handle messages for a moment.

        Raises:
            Interrupted: on Ctrl-C and the like.
        """
        if self.stop.requested:
            raise Interrupted
        self._pump.handle(timeout)

    def wait(self, look: Callable[[], Found | None], patience: float = PATIENCE) -> Found | None:
        """
        Return what `look` finds as soon as that is true; None when patience [s] is over.

        Each discovery starts the wait again: on a busy machine one run appears piece
        by piece. While a run is known to be here and nothing of it is seen, it does not end.
        """
        started = changed_at = time.monotonic()
        known = self._seen()
        while True:
            found = look()
            if found:
                return found
            now, seen = time.monotonic(), self._seen()
            if seen != known:
                known, changed_at = seen, now
            is_over = now - changed_at > patience and not self._is_expecting()
            if is_over or now - started > LONGEST:
                return None
            self.spin()

    def _seen(self) -> tuple[int, int, int]:
        """Return how many nodes, topics and services are known that other commands do not have."""
        node = self.node
        kinds = node.get_topic_names_and_types(), node.get_service_names_and_types()
        return len(self._nodes()), len(_visible(kinds[0])), len(_visible(kinds[1]))

    def _is_expecting(self) -> bool:
        """
        Whether a run in this domain has not been seen yet.

        Each robot has a topic `driver`; those of one run have one process, and so the first 12
        bytes of all that is told of their publishers.
        """
        node = self.node
        domain = node.context.get_domain_id()
        here = [run for run in running() if run.domain == domain]
        runs = {run.process for run in here if not run.is_suspended}
        names = [name for name, _ in node.get_topic_names_and_types() if name.endswith('/driver')]
        ends = [end for name in names for end in node.get_publishers_info_by_topic(name)]
        return len({bytes(end.endpoint_gid[:12]) for end in ends}) < len(runs)

    def topics(self) -> dict[str, list[str]]:
        """Return the types of every topic that is not hidden, by name, once they are known."""
        known: dict[str, list[str]] = {}
        started = changed_at = time.monotonic()
        while True:
            now = time.monotonic()
            latest = _visible(self.node.get_topic_names_and_types())
            if latest != known:
                known, changed_at = latest, now
            is_alone = len(self.node.get_node_names()) < 2
            enough = PATIENCE if is_alone else SHORTEST_LOOK
            enough = LONGEST if self._is_expecting() else enough
            if now - started > enough and now - changed_at > QUIET:
                return known
            self.spin()

    def type_of(self, what: str, name: str) -> str:
        """
        Return the type of a `topic` or a `service` with a full name.

        Raises:
            NotFound: there is none, or there are two topics of that name.
        """
        node = self.node
        is_topic = what == 'topic'
        look = node.get_topic_names_and_types if is_topic else node.get_service_names_and_types
        kinds = self.wait(lambda: dict(look()).get(name))
        if kinds is None:
            # Every node has six services of parameters; they are not what was meant.
            known = [one for one in _visible(look()) if not re.search(r'/\w+_parameter\w*$', one)]
            raise NotFound(f'no {what} {name}{self._cure(name, known)}')
        if is_topic and len(kinds) > 1:
            raise NotFound(f'topic {name} has several types: {", ".join(kinds)}; give one')
        return str(kinds[0])

    def require_node(self, name: str) -> None:
        """
        Wait for a node with a full name.

        Raises:
            NotFound: there is no such node.
        """

        def is_there() -> bool:
            # A node's name comes by a message of its own, which may be later than its services.
            return name in self._nodes() or bool(
                self.node.count_services(f'{name}/get_parameters')
            )

        if not self.wait(is_there):
            raise NotFound(f'no node {name}{self._cure(name, self._nodes())}')

    def emptiness(self) -> str:
        """Return that no node is in this domain, and what to do; '' if there is one."""
        if self._nodes():
            return ''
        domain = self.node.context.get_domain_id()
        others = [run for run in running(os.getuid()) if run.domain != domain]
        there = ', '.join(f'{run} is in domain {run.domain}' for run in others)
        return (
            f'no node runs in ROS domain {domain}: {there or f"start one, such as {called()} go2"}'
        )

    def _nodes(self) -> list[str]:
        found = self.node.get_fully_qualified_node_names()
        return sorted({node for node in found if not topic_or_service_is_hidden(node)})

    def _cure(self, name: str, known: Sequence[str]) -> str:
        emptiness = self.emptiness()
        return f'; {emptiness}' if emptiness else suggest(name, known)


def full_name(name: str) -> str:
    """
    Return a topic, service or node name with its leading slash.

    Raises:
        UserError: it is no name.
    """
    try:
        full: str = expand_topic_name(name, 'wasd', '/')
        validate_full_topic_name(full)
    except (ValueError, NameValidationException) as error:
        # What follows is a place in rcl's sources, or a picture of the place in the name.
        reason = str(error).splitlines()[0].rpartition(', at ')
        raise UserError(f'{name!r}: {(reason[0] or reason[2]).rstrip(":")}') from None
    return full


def find_type(name: str, kind: str) -> type[Any]:
    """
    Return the class of `package/msg/Name` or `package/Name`; `kind` is msg or srv.

    Raises:
        UserError: there is no such type here.
    """
    match = re.fullmatch(rf'(\w+)/(?:{kind}/)?(\w+)', name)
    if match is None:
        raise UserError(f'type {name!r}: wanted package/{kind}/Name')
    package, last = match.groups()
    try:
        module = importlib.import_module(f'{package}.{kind}')
    except ImportError:
        raise UserError(f'type {name}: {package} is not installed here') from None
    found = getattr(module, last, None)
    if not isinstance(found, type):
        known = [one for one in vars(module) if one[0].isupper()]
        raise UserError(f'{package} has no {kind} {last!r}{suggest(last, known)}')
    return found


def _visible(found: Sequence[tuple[str, list[str]]]) -> dict[str, list[str]]:
    return {
        name: list(kinds) for name, kinds in sorted(found) if not topic_or_service_is_hidden(name)
    }
