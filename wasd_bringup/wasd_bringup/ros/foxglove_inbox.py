# SPDX-License-Identifier: Apache-2.0
"""Messages of Foxglove's clients: velocities and keys count while their sender is alive."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
import itertools
from operator import itemgetter
import queue
import threading
from typing import Any, NamedTuple

from wasd_core.errors import UserError
from wasd_core.timing import SHORTEST_ABSENCE, Watchdog

from wasd_bringup.run.robot import Robot, Velocity

# A client that moves a robot must send at least this often [s of wall time].
SILENCE = 0.5
# Messages that come within this time after a pause of this process, or after `disarm`, are from
# before it [s].
AFTERMATH = 0.25
# Messages of all clients taken at a look, and kept between two looks, at most; and bytes of one.
AT_ONCE = 200
LONGEST_QUEUE = 2000
LARGEST = 65536


class Sender(NamedTuple):
    """A channel on which a client publishes."""

    topic: str
    encoding: str
    schema: str


class _Event(NamedTuple):
    """What a client says of a channel: its number in all that is said, and what."""

    number: int
    client: int
    channel: int
    what: Sender | bytes | None


class Target(NamedTuple):
    """A robot that clients drive, and the full names of the topics that do."""

    robot: Robot
    command_topic: str
    key_topic: str


class _Client:
    """One client: a source of its own to each robot."""

    def __init__(self, number: int, targets: Sequence[Target]) -> None:
        self._name = f'foxglove {number}'
        self._targets = targets
        self._heard = Watchdog(SILENCE)
        self.senders: dict[int, Sender] = {}

    def hear(self) -> None:
        """Note that it lives."""
        self._heard.hear()

    def drive(self, target: Target, velocity: Velocity, counts: bool) -> None:
        self.hear()
        robot = target.robot
        if not counts:
            robot.drivers.take(self._name, velocity=velocity)
            robot.drivers.disarm(self._name)
        elif not robot.drive(velocity, self._name):
            cure = f'to drive again send a zero, or nothing for {SILENCE} s'
            raise UserError(f'{target.command_topic}: stopped; {robot.stop_words or cure}')

    def press(self, robot: Robot, key: str, counts: bool) -> None:
        self.hear()
        if robot.heeds_e_stop(key, self._name):  # also one that has waited: a stop does no harm
            return
        if counts:
            robot.press(key, self._name)
        else:
            robot.drivers.take(self._name, key=key)
            robot.drivers.disarm(self._name)

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass; release the client if it is silent."""
        self._heard.step(dt)
        if dt > SHORTEST_ABSENCE:
            # This process stood still, not the client: its silence counts from now.
            for target in self._targets:
                target.robot.disarm(self._name)
            self.hear()
        elif not self._heard.is_alive:
            self.stop()

    def stop(self) -> None:
        """Stop what it has set moving."""
        for target in self._targets:
            target.robot.release(self._name)


class Inbox:
    """
    The server's listener: its threads put in what clients do, `step` takes it out.

    A client moves a robot only while it is heard every SILENCE [s] and stays connected. What
    waited while this process stood still is not taken. After `disarm` the velocities of a client
    count again once it has sent a zero, or nothing for SILENCE.
    """

    def __init__(
        self,
        read_velocity: Callable[[Sender, bytes], Velocity],
        read_key: Callable[[Sender, bytes], str],
    ) -> None:
        """Take how messages are read; both raise UserError."""
        self._read_velocity, self._read_key = read_velocity, read_key
        self.targets: Sequence[Target] = ()  # what clients drive; without one no message counts
        self._clients: dict[int, _Client] = {}
        # By clients: what each says waits on its own.
        self._events: dict[int, deque[_Event]] = {}
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._subscriptions: queue.SimpleQueue[tuple[str, int, bool]] = queue.SimpleQueue()
        self._deaf = 0.0

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Note that a client follows a topic; in a thread of the server, as all that follow."""
        self._subscriptions.put((channel.topic, client.id, True))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Note that it does no more."""
        self._subscriptions.put((channel.topic, client.id, False))

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Note what a client wants to publish."""
        sender = Sender(channel.topic, channel.encoding, channel.schema_name)
        self._put(client.id, channel.id, sender)

    def on_client_unadvertise(self, client: Any, channel_id: int) -> None:
        """Note that it will not, or has gone."""
        self._put(client.id, channel_id, None)

    def on_message_data(self, client: Any, channel_id: int, data: bytes) -> None:
        """Note what a client says; a flood is cut."""
        if len(data) <= LARGEST:
            self._put(client.id, channel_id, data)

    def _put(self, client_id: int, channel: int, what: Sender | bytes | None) -> None:
        with self._lock:
            events = self._events.setdefault(client_id, deque())
            if not isinstance(what, bytes) or len(events) < LONGEST_QUEUE // len(self._events):
                events.append(_Event(next(self._numbers), client_id, channel, what))

    def subscriptions(self) -> Iterator[tuple[str, int, bool]]:
        """Yield topic, client and whether it follows it now, in the order of the events."""
        while not self._subscriptions.empty():
            yield self._subscriptions.get_nowait()

    def step(self, dt: float) -> list[str]:
        """Let `dt` [s] pass and do what clients say; return why some of it was not done."""
        self._deaf = AFTERMATH if dt > SHORTEST_ABSENCE else max(self._deaf - dt, 0.0)
        for client in self._clients.values():
            client.step(dt)
        refused: list[str] = []
        for event in self._next():
            try:
                self._take(*event[1:])
            except UserError as error:
                refused.append(str(error))
        return refused[-1:]

    def disarm(self) -> None:
        """Ignore what has come so far."""
        self._deaf = AFTERMATH

    def stop(self) -> None:
        """Stop what clients have set moving."""
        for client in self._clients.values():
            client.stop()

    def _next(self) -> list[_Event]:
        """Return what is heard at a look, as it came: as much of each, for none drowns others."""
        with self._lock:
            share = max(AT_ONCE // max(len(self._events), 1), 1)
            taken = [
                events.popleft()
                for events in self._events.values()
                for _ in range(min(len(events), share))
            ]
            self._events = {number: events for number, events in self._events.items() if events}
        return sorted(taken, key=itemgetter(0))  # an e-stop ends what was said before it

    def _take(self, client_id: int, channel: int, what: Sender | bytes | None) -> None:
        client = self._clients.setdefault(client_id, _Client(client_id, self.targets))
        if isinstance(what, Sender):
            client.senders[channel] = what
        elif what is None:
            client.stop()
            client.senders.pop(channel, None)
            if not client.senders:
                del self._clients[client_id]
        elif channel in client.senders:
            self._obey(client, client.senders[channel], what)
        else:
            client.hear()

    def _obey(self, client: _Client, sender: Sender, data: bytes) -> None:
        for target in self.targets:
            if sender.topic == target.command_topic:
                return client.drive(target, self._read_velocity(sender, data), not self._deaf)
            if sender.topic == target.key_topic:
                return client.press(target.robot, self._read_key(sender, data), not self._deaf)
        known = [topic for target in self.targets for topic in target[1:]]
        raise UserError(
            f'{sender.topic}: clients cannot publish there; wanted {" or ".join(known)}'
        )
