# SPDX-License-Identifier: Apache-2.0
"""The node that publishes keys, and the executable `key_publisher`."""

from collections.abc import Callable, Iterator, Sequence
import contextlib
import functools
import sys
import time

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import String
from wasd_core.command_line import Executable
from wasd_core.errors import UserError
from wasd_core.node import init_ros, MessagePump, open_node, run_program
from wasd_core.output_file import OutputFile
from wasd_core.ros_parameters import declare_parameters
from wasd_core.signals import StopSignals
from wasd_core.streams import visible
from wasd_core.timing import STOP_KEY
from wasd_core.topics import EVENTS, LATCHED

from teleop_keyboard.key_reader import KeyReader, open_key_reader, WaitingKeys
from teleop_keyboard.key_script import KeyScriptWriter
from teleop_keyboard.parameters import key_publisher, KeyParameters

# How long one wait for keys lasts [s]; keys end it at once, signals are seen after it.
POLL_PERIOD = 0.05
# How often services (parameters) are answered [s]; each look costs more than a wait for keys.
SERVICE_PERIOD = 0.25
# A pipe is read after somebody listens, or after this time [s].
SUBSCRIBER_TIMEOUT = 5.0
# How long the last messages may take to leave the process [s].
LAST_WORDS_TIMEOUT = 0.1
LAST_KEYS_TIMEOUT = 2.0


class KeyPublisherNode(Node):
    """
    Publishes each key as one std_msgs/String on `keys`.

    `receivers` are called with the same message first: nodes of the same process that must have
    it in the same instant.
    """

    def __init__(self, *, namespace: str = '') -> None:
        super().__init__('key_publisher', namespace=namespace)
        self.receivers: list[Callable[[String], None]] = []
        settings = declare_parameters(self, KeyParameters)
        self.raw, self.help = settings.raw, settings.help
        self._publisher = self.create_publisher(String, 'keys', EVENTS)

    @property
    def has_subscriber(self) -> bool:
        """Whether anybody listens to `keys`."""
        return self._publisher.get_subscription_count() > 0

    def publish_key(self, key: str) -> None:
        """Publish one key."""
        message = String(data=key)
        for receiver in self.receivers:
            receiver(message)
        self._publisher.publish(message)

    def save_to(self, file: OutputFile) -> None:
        """
        Write every key to a script, in seconds of this node's clock from now on.

        If no simulated time is known yet, it counts from the first key with a time. After a jump
        back, time goes on from the key before.
        """
        writer, script_time, last = KeyScriptWriter(file), 0, self.get_clock().now()

        def save(message: String) -> None:
            nonlocal script_time, last
            now = self.get_clock().now()
            if last.nanoseconds:
                script_time += max((now - last).nanoseconds, 0)
            last = now
            writer.write(1e-9 * script_time, message.data)

        self.receivers.append(save)

    def close(self, patience: float = LAST_WORDS_TIMEOUT) -> None:
        """Give the last keys so much time [s] to leave the process."""
        self._publisher.wait_for_all_acked(Duration(seconds=patience))


class KeyService:
    """
    Publishes the keys of a KeyPublisherNode once there is a subscriber.

    With a `help` it says that, the robot's state, and which keys wait.
    """

    def __init__(self, node: KeyPublisherNode) -> None:
        self._node = node
        self._waiting = WaitingKeys()
        self._stepped_at = time.monotonic()
        self._is_talking = bool(node.help)
        if self._is_talking:
            print(node.help, flush=True)
            _subscribe_to_state(node)

    def press(self, key: str) -> None:
        """Publish a key, or keep it while nobody listens."""
        self.step()
        if self._node.has_subscriber:
            self._node.publish_key(key)
            return
        if not self._waiting:
            self.say(f'nobody listens to the keys yet: {key} waits')
        self._waiting.put(key)

    def step(self) -> None:
        """Publish what has waited, if somebody listens now; to be called all the time."""
        now = time.monotonic()
        late = self._waiting.step(now - self._stepped_at)
        self._stepped_at = now
        if late:
            self.say(f'nobody listens to the keys: {" ".join(late)} dropped')
        if self._waiting and self._node.has_subscriber:
            for key in self._waiting.take():
                self._node.publish_key(key)

    def say(self, text: str) -> None:
        """Tell the driver, where there is something to tell."""
        if text and self._is_talking:
            print(text, flush=True)


def _subscribe_to_state(node: Node) -> None:
    shown = ''

    def show(message: String) -> None:
        nonlocal shown
        if message.data != shown:
            shown = message.data
            print(f'state: {visible(shown)}', flush=True)

    node.create_subscription(String, 'state', show, LATCHED)


@contextlib.contextmanager
def open_keyboard(
    program: Executable, words: Sequence[str] | None, stop: StopSignals
) -> Iterator[tuple[KeyReader, OutputFile | None]]:
    """
    Context with the keys of a program's user, and where they are to be saved; ROS is started.

    Raises:
        UserError: there is nowhere to read keys from, or an option is wrong.
    """
    options = program.read(sys.argv[1:] if words is None else words)
    path = options.save_keys
    file = None if path is None else OutputFile(path, '--save-keys')
    reader = open_key_reader()
    with contextlib.closing(file) if file else contextlib.nullcontext(), reader:
        if reader.terminal is not None:
            stop.last_words.append(reader.terminal.restore)
        init_ros(options.ros, joins=True)
        yield reader, file


def wait_for_subscriber(has_subscriber: Callable[[], bool], stop: StopSignals) -> None:
    """Wait until somebody listens, so that keys from a pipe are not lost before; not for ever."""
    deadline = time.monotonic() + SUBSCRIBER_TIMEOUT
    while not (has_subscriber() or stop.requested or time.monotonic() > deadline):
        time.sleep(POLL_PERIOD)


def publish_keys(node: KeyPublisherNode, reader: KeyReader, stop: StopSignals) -> None:
    """Publish keys as they come until a signal or until no more can come."""
    executor = MessagePump()
    executor.add_node(node)
    if reader.keys_can_wait:
        wait_for_subscriber(lambda: node.has_subscriber, stop)
    service = KeyService(node)
    next_service = time.monotonic()
    while rclpy.ok() and not (stop.requested or reader.closed):
        with reader.undisturbed():
            keys = reader.poll(POLL_PERIOD)
            # Messages of /clock, too: keys get the time of now.
            if keys or time.monotonic() >= next_service:
                executor.handle()
                next_service = time.monotonic() + SERVICE_PERIOD
            for key in keys:
                service.press(key)
        service.say(reader.take_notice())
        service.step()
    if not stop.requested:
        # A pipe has ended with keys that nobody has yet; a signal wants an end at once.
        node.close(LAST_KEYS_TIMEOUT)


def _publish(args: Sequence[str] | None, stop: StopSignals) -> None:
    with (
        open_keyboard(key_publisher, args, stop) as (reader, file),
        open_node(KeyPublisherNode, stop) as node,
    ):
        if file is not None:
            if node.raw:
                raise UserError('--save-keys saves names of keys: leave out raw:=true')
            node.save_to(file)
        if reader.terminal is not None:
            # While it is suspended, it cannot publish releases.
            reader.terminal.before_suspend += [lambda: node.publish_key(STOP_KEY), node.close]
        reader.pass_on(node.raw)
        publish_keys(node, reader, stop)


def main(args: Sequence[str] | None = None) -> int:
    """Run `key_publisher`; return the exit status."""
    return run_program(functools.partial(_publish, args))


if __name__ == '__main__':
    sys.exit(main())
