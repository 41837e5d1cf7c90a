# SPDX-License-Identifier: Apache-2.0
"""`--foxglove`: a run's topics by WebSocket, and its clients' messages as cmd_vel and keys."""

from collections.abc import Callable, Iterable, Sequence
import json
import logging
import math
import os
import queue
import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from wasd_core.errors import one_line, UserError
from wasd_core.extras import import_extra
from wasd_core.network import LOOPBACK
from wasd_core.streams import visible
from wasd_core.timing import Beat
from wasd_core.topics import FOLLOWED
from wasd_core.velocity_messages import to_velocity

from wasd_bringup.ros.foxglove_gate import Gate, secret_host
from wasd_bringup.ros.foxglove_inbox import Inbox, Sender, Target
from wasd_bringup.run.robot import Velocity
from wasd_bringup.tools.graph.ros_graph import find_type
from wasd_bringup.tools.messages import fill, type_name
from wasd_bringup.tools.recording.recorder import full_definition, IGNORED, PublisherTap

# CDR begins with its representation, of which ROS has these: big and little endian.
REPRESENTATIONS = (b'\0\0', b'\0\1')
HEADER = 4
# The extra `foxglove` brings it; a name, so that nothing else asks for it.
SDK = 'foxglove'
ENCODINGS = ('cdr', 'json')
# New publishers are looked for, and the time is told, so often [Hz of wall time].
LOOK_RATE = 2.0
TIME_RATE = 20.0
# How much of a refused page's address is said, and of how many.
LONGEST_NAME, MOST_REFUSED = 60, 10


def read_velocity(sender: Sender, data: bytes) -> Velocity:
    """
    Return the velocity of a Twist or TwistStamped [m/s], [m/s], [rad/s].

    Raises:
        UserError: it is no such message, or not finite.
    """
    velocity = to_velocity(_read(sender, data, (Twist, TwistStamped)))
    if not all(map(math.isfinite, velocity)):
        raise UserError(f'{sender.topic}: a velocity that is not finite')
    return velocity


def read_key(sender: Sender, data: bytes) -> str:
    """
    Return the key of a String.

    Raises:
        UserError: it is no such message.
    """
    text: str = _read(sender, data, (String,)).data
    return text


def _read(sender: Sender, data: bytes, kinds: Sequence[type[Any]]) -> Any:
    """Return a message of one of the kinds, the one that its schema names."""
    names = {type_name(kind).replace('/msg/', '/'): kind for kind in kinds}
    kind = names.get(sender.schema.replace('/msg/', '/'))
    if kind is None:
        wanted = ' or '.join(names)
        raise UserError(f'{sender.topic}: got {sender.schema or "no schema"}, wanted {wanted}')
    try:
        if sender.encoding == 'cdr':
            if data[:2] not in REPRESENTATIONS or len(data) <= HEADER:
                raise ValueError('no CDR')
            return deserialize_message(data, kind)
        if sender.encoding == 'json':
            message = kind()
            fill(message, json.loads(data), lambda name: find_type(name, 'msg'))
            return message
    except (ArithmeticError, AssertionError, RuntimeError, RecursionError, ValueError) as error:
        raise UserError(f'{sender.topic}: {one_line(error)}') from None
    raise UserError(f'{sender.topic}: got {sender.encoding}, wanted cdr or json')


def load_sdk() -> Any:
    """
    Return Foxglove's library, told to be silent: our terminal is the driver's.

    Raises:
        UserError: it is not installed; says how it comes.
    """
    sdk = import_extra(SDK, 'foxglove', '--foxglove')
    import_extra(f'{SDK}.websocket', 'foxglove', '--foxglove')
    if not logging.root.handlers and logging.lastResort is not None:
        # Without a handler the library adds its own: to the error stream of now, in its own words.
        logging.root.addHandler(logging.lastResort)
    sdk.set_log_level('CRITICAL')
    return sdk


class FoxgloveServer:
    """
    Serves what this process publishes, from its construction to `shut_down`.

    Its clients drive a run that it has joined, after `drive`. Only what a client has subscribed
    to is made and serialised; it keeps the last messages of latched topics for late clients. `now`
    returns simulated time [ns].
    """

    def __init__(self, port: int) -> None:
        """
        Begin to serve on a port of this machine, 0 for any.

        Raises:
            UserError: the library is not installed, or the port is taken.
        """
        self.now: Callable[[], int] = lambda: 0
        self.inbox = Inbox(read_velocity, read_key)
        self._sdk = load_sdk()
        self._context = self._sdk.Context()
        self._channels: dict[str, Any] = {}
        # Topics that never get a channel.
        self._refused = {IGNORED}
        self._kept: dict[str, list[bytes]] = {}
        self._latched: set[str] = set()
        self._followers: dict[str, int] = {}
        # Where pages are from that were refused, and those of which that was said.
        self._strangers: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._told: set[str] = set()
        self._publishing: Sequence[Node] = ()
        self._looks, self._times = Beat(), Beat()
        capability, host = self._sdk.websocket.Capability, secret_host()
        try:
            self._server = self._sdk.start_server(
                name='wasd',
                host=host,
                port=0,
                capabilities=[capability.ClientPublish, capability.Time],
                supported_encodings=list(ENCODINGS),
                server_listener=self.inbox,
                context=self._context,
            )
        except RuntimeError as error:
            raise UserError(f'--foxglove: {one_line(error)}') from None
        try:
            self._gate = Gate(port, (host, self._server.port), self._strangers.put)
        except OSError as error:
            self._server.stop()
            reason = os.strerror(error.errno or 0).lower()
            taken = f'--foxglove: port {port} of {LOOPBACK}: {reason}; give another'
            raise UserError(taken) from None
        self.port = self._gate.port
        self._tap = PublisherTap(self._hear, self._wants)

    def offer(self, nodes: Iterable[Node]) -> None:
        """Tell clients of every topic that these nodes publish, with its definition."""
        for node in nodes:
            publishers: Iterable[Any] = node.publishers
            for publisher in publishers:
                topic: str = publisher.topic_name
                if topic in self._channels or topic in self._refused:
                    continue
                kind = type_name(publisher.msg_type)
                try:
                    text = full_definition(kind)
                except UserError:
                    self._refused.add(topic)  # its package came without definitions
                    continue
                if publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                    self._latched.add(topic)
                schema = self._sdk.Schema(name=kind, encoding='ros2msg', data=text.encode())
                self._channels[topic] = self._sdk.Channel(
                    topic, message_encoding='cdr', schema=schema, context=self._context
                )

    def take_subscriptions(self) -> None:
        """Follow what clients have subscribed to since the last call."""
        for topic, client, comes in self.inbox.subscriptions():
            count = max(self._followers.get(topic, 0) + (1 if comes else -1), 0)
            self._followers[topic] = count
            (FOLLOWED.add if count else FOLLOWED.discard)(topic)
            for data in self._kept.get(topic, ()) if comes else ():
                self._channels[topic].log(data, log_time=self.now(), sink_id=client)

    def _wants(self, topic: str) -> bool:
        # Before a topic is known it may be a latched one.
        is_new = topic not in self._channels and topic not in self._refused
        return topic in FOLLOWED or topic in self._latched or is_new

    def _hear(self, topic: str, kind: str, profile: Any, data: bytes) -> None:
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            kept = self._kept.setdefault(topic, [])
            if data not in kept:
                kept.append(data)
            del kept[: -profile.depth]
        if topic in FOLLOWED and topic in self._channels:
            self._channels[topic].log(data, log_time=self.now())

    def drive(self, targets: Sequence[Target], publishing: Sequence[Node]) -> None:
        """Let clients drive from now on, and offer them what these nodes publish."""
        self.inbox.targets, self._publishing = targets, publishing
        self._looked_at = time.monotonic()

    @property
    def first_line(self) -> str:
        """Where it is."""
        return f'foxglove: ws://{LOOPBACK}:{self.port}'

    def look(self) -> None:
        """Take what clients have sent, and offer them what is new."""
        now = time.monotonic()
        if self._looks.is_due(now, LOOK_RATE):
            self.offer(self._publishing)
        self.take_subscriptions()
        for words in self.inbox.step(now - self._looked_at):
            self._server.publish_status(words, self._sdk.websocket.StatusLevel.Warning, 'wasd')
        self._looked_at = now
        if self._times.is_due(now, TIME_RATE):
            self._server.broadcast_time(self.now())
        # Once of each page.
        while not self._strangers.empty():
            page = visible(self._strangers.get())[:LONGEST_NAME]
            if page and page not in self._told and len(self._told) < MOST_REFUSED:
                self._told.add(page)
                words = f'foxglove: a page of {page} wants to drive: refused'
                self.inbox.targets[0].robot.say(words)

    def repeat(self) -> None:
        """Say nothing again: a client that is silent drives no more."""

    def disarm(self) -> None:
        """Ignore what clients have sent so far."""
        self.inbox.disarm()

    def close(self) -> None:
        """Stop what clients drive; they still hear the end of the run."""
        self.inbox.stop()

    def shut_down(self) -> None:
        """Serve no more."""
        self._tap.remove()
        FOLLOWED.difference_update(self._followers)
        self._gate.close()
        self._server.stop()
