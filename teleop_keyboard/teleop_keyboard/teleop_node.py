# SPDX-License-Identifier: Apache-2.0
"""The executable `teleop`: keys and velocity commands in one process on one terminal."""

from collections.abc import Sequence
import contextlib
import functools
import math
import sys
import time
from typing import Any

from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
from wasd_core.node import explain_ros_errors, MessagePump, run_program
from wasd_core.ros_parameters import misspelt_parameters
from wasd_core.signals import StopSignals
from wasd_core.streams import visible
from wasd_core.timing import is_press, Notice
from wasd_core.topics import LATCHED, LATEST

from teleop_keyboard import parameters
from teleop_keyboard.dashboard import (
    dashboard,
    HELP_KEY,
    HELP_KEYS,
    KeyHints,
    plain_line,
    Surroundings,
)
from teleop_keyboard.key_publisher_node import KeyPublisherNode, open_keyboard, wait_for_subscriber
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.keymap import table_lines
from teleop_keyboard.keys_to_twist import Velocity
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.screen import Screen
from teleop_keyboard.terminal import tolerate_any_text
from teleop_keyboard.twist_messages import from_twist

# Odometry older than this is none [s].
ODOMETRY_LIFETIME = 1.0


class RobotMonitorNode(Node):
    """Listens to `odom` and `state`; both may be silent."""

    def __init__(self) -> None:
        super().__init__('robot_monitor')
        self._velocity: Velocity | None = None
        self._heard_at = self.get_clock().now()
        self.state: str | None = None
        self._inputs = [
            self.create_subscription(Odometry, 'odom', self._on_odometry, LATEST),
            self.create_subscription(String, 'state', self._on_state, LATCHED),
        ]

    @property
    def velocity(self) -> Velocity | None:
        """The robot's velocity by its odometry, None when there is none of late."""
        age = 1e-9 * (self.get_clock().now() - self._heard_at).nanoseconds
        return self._velocity if age < ODOMETRY_LIFETIME else None

    def _on_odometry(self, message: Odometry) -> None:
        self._velocity = from_twist(message.twist.twist)
        self._heard_at = self.get_clock().now()

    def _on_state(self, message: String) -> None:
        self.state = message.data


# How long one wait for keys lasts [s]: bounds how late a timer of the nodes fires ...
POLL_PERIOD = 0.01
# ... and while nothing is to be published until the next key, which ends the wait.
SILENT_POLL_PERIOD = 0.1
# The dashboard is looked after this often [s].
LOOK_PERIOD = 0.05


class Teleop:
    """
    Both nodes of a teleoperation, fed from one reader of keys.

    Keys reach the velocity commands directly and in the same instant; they are published, too.
    """

    def __init__(self, reader: KeyReader) -> None:
        self._reader = reader
        self._looked_at = -math.inf
        self._shows_help = False
        self._executor = MessagePump()
        self.twist = KeysToTwistNode()
        self.keys = KeyPublisherNode()
        self.keys.receivers += [self.twist.keys.expect, self.twist.keys.hear]
        self._hints = KeyHints(self.twist.logic, HELP_KEY)
        self._notice = Notice()
        self._monitor = RobotMonitorNode()
        self._nodes: tuple[Any, ...] = (self.keys, self.twist, self._monitor)
        for node in self._nodes:
            self._executor.add_node(node)
        for text in misspelt_parameters(*self._nodes):
            self.twist.get_logger().warning(visible(text))
            self._notice.say(text)
        if reader.terminal is not None:
            # A suspended process cannot stop the robot any more.
            reader.terminal.before_suspend.append(self.twist.close)

    def run(self, stop: StopSignals, screen: Screen) -> None:
        """Handle keys and messages until a signal or until no more key can come."""
        if self._reader.keys_can_wait:
            wait_for_subscriber(lambda: self.twist.output.subscriber_count > 0, stop)
        while rclpy.ok() and not (stop.requested or self._is_finished):
            period = SILENT_POLL_PERIOD if self.twist.logic.is_silent else POLL_PERIOD
            with self._reader.undisturbed():
                for key in self._reader.poll(period):
                    self.keys.publish_key(key)
                    self._answer(key, screen)
            if notice := self._reader.take_notice():
                self._notice.say(notice)
            self._executor.handle()
            # A screen that Ctrl-Z gives back in the midst of a frame would count as open after it.
            with self._reader.undisturbed():
                self._show(screen)

    def _answer(self, key: str, screen: Screen) -> None:
        """Say what a press did where that is not seen, or show the keys."""
        if not is_press(key):
            return
        keymap = self.twist.logic.keymap
        if key not in HELP_KEYS or key in keymap.keys:
            self._shows_help = False
            self._notice.say(self._hints.press(key))
        elif screen.is_terminal:
            self._shows_help = not self._shows_help
        else:
            print('\n'.join(table_lines(keymap)), flush=True)

    def _show(self, screen: Screen) -> None:
        now = time.monotonic()
        if now < self._looked_at + LOOK_PERIOD:
            return
        self._notice.step(now - self._looked_at)
        self._looked_at = now
        logic = self.twist.logic
        around = Surroundings(
            velocity=self._monitor.velocity,
            state=self._monitor.state,
            subscribers=self.twist.output.subscriber_count,
            message_type=self.twist.output.type.__name__,
            hint=self._notice.text,
            shows_help=self._shows_help,
        )
        screen.show(lambda width, height: dashboard(logic, around, width, height), now)
        screen.log(plain_line(logic, around), now)

    @property
    def _is_finished(self) -> bool:
        """Whether no key can come any more and those from a pipe have had their effect."""
        if not self._reader.closed:
            return False
        terminal = self._reader.terminal
        if terminal is not None and terminal.closed:
            return True
        logic = self.twist.logic
        return not (logic.is_moving and logic.motion.mode == 'hold')

    def close(self) -> None:
        """Leave the robot stopped and release the nodes."""
        try:
            self.twist.close()
            self.keys.close()
        finally:
            self._executor.shutdown(timeout_sec=0.0)
            for node in self._nodes:
                node.destroy_node()


def _prepare(reader: KeyReader, screen: Screen, teleop: Teleop, stop: StopSignals) -> None:
    """Leave the screen when the process is suspended; say the keys where there is no screen."""
    leave = [screen.close]
    if reader.terminal is not None:
        # What was switched on in the screen is switched off in it.
        leave.insert(0, reader.terminal.switch_off)
        reader.terminal.before_suspend += leave
    stop.last_words[:0] = [teleop.twist.close, *leave]
    if not screen.is_terminal:
        print('\n'.join(teleop.twist.logic.keymap.help_lines), end='\n\n', flush=True)


def _teleoperate(args: Sequence[str] | None, stop: StopSignals) -> None:
    with open_keyboard(parameters.teleop, args, stop) as (reader, file):
        tolerate_any_text()
        screen = Screen(sys.stdout)
        with explain_ros_errors():
            teleop = Teleop(reader)
        # First the terminal is given back: what is said from then on must be seen.
        with contextlib.closing(teleop), contextlib.closing(screen):
            if file is not None:
                teleop.keys.save_to(file)
            _prepare(reader, screen, teleop, stop)
            teleop.run(stop, screen)
            if reader.terminal is not None:
                reader.terminal.switch_off()


def main(args: Sequence[str] | None = None) -> int:
    """Run `teleop`; return the exit status."""
    return run_program(functools.partial(_teleoperate, args))


if __name__ == '__main__':
    sys.exit(main())
