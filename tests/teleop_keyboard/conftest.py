# SPDX-License-Identifier: Apache-2.0
"""Processes on pseudo-terminals, and a node that listens to them, on a ROS domain of their own."""

import os
import pty
import select
import subprocess
import sys
import termios
import threading
import time

from geometry_msgs.msg import Twist, TwistStamped
import programs
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from teleop_keyboard.keys_to_twist import STANDSTILL
from teleop_keyboard.twist_messages import from_twist
from terminals import fill, PATIENCE, wait_until

# How long a process may take to start or to end on a busy machine [s].


class PtyProcess:
    """A Python process whose terminal is a pseudo-terminal that the test types on."""

    def __init__(self, *arguments, environment=None):
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.output = b''
        self.is_gone = False
        self.process = programs.start(
            [*programs.ON_TERMINAL, *arguments],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env={**os.environ, 'TERM': 'xterm', **(environment or {})},
        )
        # Somebody must read the screen, or the process waits for room to write.
        self._reading = threading.Lock()
        self._closing = threading.Event()
        self._is_read = threading.Event()
        self._is_read.set()
        self._reader = threading.Thread(target=self._collect, daemon=True)
        self._reader.start()

    def _collect(self):
        while not self._closing.is_set():
            if not self._is_read.wait(0.05):
                continue
            select.select([self.master], [], [], 0.05)
            self._read_on()

    def _read_on(self):
        with self._reading:
            while self._is_read.is_set() and select.select([self.master], [], [], 0.0)[0]:
                # Read first: a test may have emptied `output` meanwhile.
                data = os.read(self.master, 65536)
                self.output += data

    @property
    def attributes(self):
        """Attributes of the terminal now."""
        return termios.tcgetattr(self.slave)

    @property
    def is_raw(self):
        """Whether keys come one at a time, unechoed."""
        return not self.attributes[3] & (termios.ICANON | termios.ECHO)

    def wait_for(self, text):
        """Wait until a text is on the screen."""
        wait_until(lambda: text in self.output)

    def type(self, data):
        """Type bytes, all at once."""
        os.write(self.master, data)

    def freeze(self):
        """Read no more, as a connection that has died, and leave no room for another byte."""
        with self._reading:
            self._is_read.clear()
        fill(self.slave)

    def thaw(self):
        """Read on."""
        self._is_read.set()

    def hang_up(self):
        """Close the terminal, as a window that is closed."""
        self._closing.set()
        self._reader.join()
        os.close(self.slave)
        os.close(self.master)
        self.is_gone = True

    def wait(self):
        """Wait for the end of the process, read its last words, and return its status."""
        status = self.process.wait(PATIENCE)
        if not self.is_gone:
            self._read_on()
        return status

    def close(self):
        """End the process if it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        # Descriptors are numbers that the next test gets again: nobody may read them then.
        self._closing.set()
        self._reader.join()
        if not self.is_gone:
            os.close(self.master)
            os.close(self.slave)


@pytest.fixture
def pty_process():
    """Return a function that starts a Python process on a pseudo-terminal."""
    processes = []

    def start(*arguments, environment=None):
        processes.append(PtyProcess(*arguments, environment=environment))
        return processes[-1]

    yield start
    for process in processes:
        process.close()


@pytest.fixture
def ros_domain(isolated_ros):
    """Return the number of a ROS domain that nobody else uses; children inherit it."""
    return isolated_ros


@pytest.fixture
def context(ros_domain):
    """Return a ROS context in the domain of the test."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    rclpy.try_shutdown(context=context)


class Listener:
    """A node that collects what comes on `keys` and `cmd_vel`, in a thread of its own."""

    def __init__(self, context, twist_type):
        self.keys = []
        self.twists = []
        self.node = rclpy.create_node('listener', context=context)
        self.node.create_subscription(String, 'keys', lambda m: self.keys.append(m.data), 10_000)
        self.moved_at = 0.0  # when the last command to move was sent [s]
        self.node.create_subscription(twist_type, 'cmd_vel', self._hear, 1000)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _hear(self, message, info):
        self.twists.append(message)
        if from_twist(message) != STANDSTILL:
            self.moved_at = 1e-9 * info['source_timestamp']

    @property
    def velocities(self):
        """What came on `cmd_vel`."""
        return [from_twist(message) for message in list(self.twists)]

    @property
    def stands(self):
        """Whether the last command is to stand."""
        return self.velocities[-1:] == [STANDSTILL]

    def drive(self, process, key=b'i', seconds=0.0):
        """Hold a key until the robot is told to move, and then so long."""

        def press():
            process.type(key)
            time.sleep(1 / 30)
            return any(velocity.vx > 0.1 for velocity in self.velocities)

        wait_until(press)
        for _ in range(round(30 * seconds)):
            press()

    def probe(self, process, key='P', sequence=None, names=None, last=(b'Y', 'Y')):
        """
        Type a key until it arrives, so that both sides have found each other; forget it.

        `sequence` is what the terminal sends for it, `names` what is published then. `last` are
        both of a key that comes after all of these.
        """

        def arrives():
            process.type(sequence or key.encode())
            time.sleep(0.1)
            return bool(self.keys)

        wait_until(lambda: process.is_raw)
        wait_until(arrives)
        process.type(last[0])
        wait_until(lambda: self.keys[-1] == last[1])
        self.settle()
        assert set(self.keys[: self.keys.index(last[1])]) <= (names or {key})
        self.keys.clear()
        self.twists.clear()

    def wait_for_keys(self, count):
        """Wait until so many keys have come."""
        wait_until(lambda: len(self.keys) >= count)

    def wait_for_twist(self, condition, step=None):
        """Wait until a velocity fulfils a condition; `step` is called every 1/30 s."""

        def fulfilled():
            if any(condition(from_twist(message)) for message in list(self.twists)):
                return True
            if step is not None:
                time.sleep(1 / 30)
                step()
            return False

        wait_until(fulfilled)

    def settle(self, keys=0, quiet=0.4):
        """Wait until so many keys have come, and then nothing for a while [s]."""
        self.wait_for_keys(keys)
        count, deadline = -1, time.monotonic() + PATIENCE
        while count != len(self.keys) + len(self.twists):
            count = len(self.keys) + len(self.twists)
            assert time.monotonic() < deadline, 'it never falls silent'
            time.sleep(quiet)

    def close(self):
        """Stop listening."""
        self._executor.shutdown()
        self._thread.join(PATIENCE)
        self.node.destroy_node()


@pytest.fixture
def listener(context):
    """Return a node of this process that listens to the processes under test."""
    listener = Listener(context, Twist)
    yield listener
    listener.close()


@pytest.fixture
def late_listener(context):
    """Return a function that makes a listener, when the test wants it."""
    made = []

    def make():
        made.append(Listener(context, Twist))
        return made[-1]

    yield make
    for listener in made:
        listener.close()


@pytest.fixture
def stamped_listener(context):
    """Return a listener to TwistStamped."""
    listener = Listener(context, TwistStamped)
    yield listener
    listener.close()


@pytest.fixture
def background():
    """Return a function that starts a module as a process without a terminal."""
    processes = []

    def start(module, *arguments):
        processes.append(
            programs.start(
                [sys.executable, '-m', module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        )
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.wait()
