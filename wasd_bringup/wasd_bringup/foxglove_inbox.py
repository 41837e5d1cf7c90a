# SPDX-License-Identifier: Apache-2.0
"""What Foxglove's clients send: velocities and keys, in force only while their sender is alive."""

from collections.abc import Callable, Iterator, Sequence
import queue
from typing import Any, NamedTuple, Protocol

from wasd_core.errors import UserError
from wasd_core.timing import SHORTEST_ABSENCE, Watchdog

from wasd_bringup.inputs import Drive, PageDrive

Velocity = tuple[float, float, float]
STANDSTILL = (0.0, 0.0, 0.0)
# A client that moves a robot is to be heard so often [s of wall time].
SILENCE = 0.5
# When we have stood still, what comes in so long after it is of before [s].
AFTERMATH = 0.25
# Messages taken at a look, and kept between two looks, at most; and bytes of one.
AT_ONCE = 200
LONGEST_QUEUE = 2000
LARGEST = 65536


class Stack(Drive, Protocol):
    """What drives a robot."""

    @property
    def stop_key(self) -> str:
        """The key that ends every motion that keys have set going."""

    @property
    def command_topic(self) -> str:
        """Its cmd_vel, by its full name."""


class Robot(Protocol):
    """A robot that clients drive."""

    @property
    def stack(self) -> Stack:
        """What drives it."""

    @property
    def key_topic(self) -> str:
        """Its keys, by their full name."""

    def press(self, key: str) -> None:
        """Press a key, and tell whoever listens."""

    def drive(self, velocity: Velocity) -> None:
        """Command a velocity [m/s], [m/s], [rad/s]."""


class Sender(NamedTuple):
    """A channel on which a client publishes."""

    topic: str
    encoding: str
    schema: str


class Decode(NamedTuple):
    """How a message is read; both raise UserError."""

    velocity: Callable[[Sender, bytes], Velocity]
    key: Callable[[Sender, bytes], str]


class _Client:
    """What one client has set moving."""

    def __init__(self, robots: Sequence[Robot]) -> None:
        self._robots = robots
        self._keys = PageDrive([robot.stack for robot in robots])
        self._driven: set[int] = set()
        # The robots that it moves again after it has let them go.
        self._held: set[int] = set()
        self._heard = Watchdog(SILENCE)
        self.senders: dict[int, Sender] = {}

    def hear(self) -> None:
        """Note that it lives."""
        self._heard.hear()

    def drive(self, robot: int, velocity: Velocity) -> None:
        self.hear()
        if not any(velocity):
            self._held.discard(robot)
        elif robot in self._held:
            topic = self._robots[robot].stack.command_topic
            raise UserError(
                f'{topic}: stopped; to drive again send a zero, or nothing for {SILENCE} s'
            )
        (self._driven.add if any(velocity) else self._driven.discard)(robot)
        self._robots[robot].drive(velocity)

    def press(self, robot: int, key: str) -> None:
        self.hear()
        self._keys.press(robot, key, from_view=True)
        self._robots[robot].press(key)

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass: who is silent drives no more, and has let go."""
        self._heard.step(dt)
        if dt > SHORTEST_ABSENCE:
            # It was we who heard nothing: its silence counts from now on.
            self.stop()
            self.hear()
        elif not self._heard.is_alive:
            self.stop()
            self._held.clear()

    def hold(self) -> None:
        """Stop what it has set moving; no robot moves again before it was let go."""
        self.stop()
        self._held.update(range(len(self._robots)))

    def stop(self) -> None:
        """Stop what it has set moving."""
        for robot in sorted(self._driven):
            self._robots[robot].drive(STANDSTILL)
        for robot in self._keys.moved:
            self._robots[robot].press(self._robots[robot].stack.stop_key)
        self._driven.clear()
        self._keys.reset()


class Inbox:
    """
    The server's listener: its threads put in what clients do, `step` takes it out.

    A client moves a robot only while it is heard every SILENCE [s] and stays connected. What
    waited while this process stood still is not taken. After a `halt` velocities of a client count
    when it has sent a zero, or nothing for SILENCE.
    """

    def __init__(self, decode: Decode) -> None:
        self._decode = decode
        self._robots: Sequence[Robot] = ()
        self._clients: dict[int, _Client] = {}
        self._events: queue.SimpleQueue[tuple[int, int, Sender | bytes | None]] = (
            queue.SimpleQueue()
        )
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
        self._events.put((client.id, channel.id, sender))

    def on_client_unadvertise(self, client: Any, channel_id: int) -> None:
        """Note that it will not, or has gone."""
        self._events.put((client.id, channel_id, None))

    def on_message_data(self, client: Any, channel_id: int, data: bytes) -> None:
        """Note what a client says; a flood is cut."""
        if len(data) <= LARGEST and self._events.qsize() < LONGEST_QUEUE:
            self._events.put((client.id, channel_id, data))

    def receive_for(self, robots: Sequence[Robot]) -> None:
        """Say who is driven; nothing is taken before."""
        self._robots = robots

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
        for _ in range(min(self._events.qsize(), AT_ONCE)):
            try:
                self._take(*self._events.get_nowait())
            except UserError as error:
                refused.append(str(error))
        return refused[-1:]

    def halt(self) -> None:
        """Stop what clients have set moving; what has come, and goes on, is not taken."""
        self._deaf = AFTERMATH
        for client in self._clients.values():
            client.hold()

    def stop(self) -> None:
        """Stop what clients have set moving."""
        for client in self._clients.values():
            client.stop()

    def _take(self, client_id: int, channel: int, what: Sender | bytes | None) -> None:
        client = self._clients.setdefault(client_id, _Client(self._robots))
        if isinstance(what, Sender):
            client.senders[channel] = what
        elif what is None:
            client.stop()
            client.senders.pop(channel, None)
            if not client.senders:
                del self._clients[client_id]
        elif self._deaf:
            client.hear()
        elif channel in client.senders:
            self._obey(client, client.senders[channel], what)

    def _obey(self, client: _Client, sender: Sender, data: bytes) -> None:
        for index, robot in enumerate(self._robots):
            if sender.topic == robot.stack.command_topic:
                return client.drive(index, self._decode.velocity(sender, data))
            if sender.topic == robot.key_topic:
                return client.press(index, self._decode.key(sender, data))
        known = [t for r in self._robots for t in (r.stack.command_topic, r.key_topic)]
        raise UserError(f'{sender.topic}: nothing is taken there; wanted {" or ".join(known)}')
