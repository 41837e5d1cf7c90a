# SPDX-License-Identifier: Apache-2.0
"""The executable `teleop`: keys and velocity commands in one process on one terminal."""

from collections.abc import Sequence
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from robot_description.errors import UserError
from robot_description.node_support import init_ros
from robot_description.node_support import StopSignals

from teleop_keyboard.key_publisher_node import KeyPublisherNode
from teleop_keyboard.key_publisher_node import last_status
from teleop_keyboard.key_publisher_node import wait_for_subscriber
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_reader import open_key_reader
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.status_line import describe
from teleop_keyboard.status_line import StatusLine
from teleop_keyboard.terminal import NoTerminal

# How long one wait for keys lasts [s]: bounds how late a timer of the nodes fires ...
POLL_PERIOD = 0.01
# ... and while nothing is to be published until the next key, which ends the wait.
SILENT_POLL_PERIOD = 0.05
# Callbacks handled between two waits for keys: a timer and a message.
CALLBACKS_PER_POLL = 2


class Teleop:
    """
    Both nodes of a teleoperation, fed from one reader of keys.

    Keys reach the velocity commands directly and in the same instant; they are published, too.
    """

    def __init__(self, reader: KeyReader) -> None:
        self._reader = reader
        self._executor = SingleThreadedExecutor()
        self.twist = KeysToTwistNode()
        self.keys = KeyPublisherNode()
        self.keys.receivers.append(self.twist.keys.put)
        self._executor.add_node(self.keys)
        self._executor.add_node(self.twist)
        if reader.terminal is not None:
            # A suspended process cannot stop the robot any more.
            reader.terminal.before_suspend.append(self.twist.close)

    def run(self, stop: StopSignals, status: StatusLine) -> None:
        """Handle keys and messages until a signal or until no more key can come."""
        if self._reader.terminal is None:
            wait_for_subscriber(lambda: self.twist.has_subscriber, stop)
        while rclpy.ok() and not (stop.requested or self._is_finished):
            period = SILENT_POLL_PERIOD if self.twist.logic.is_silent else POLL_PERIOD
            for key in self._reader.poll(period):
                self.keys.publish_key(key)
            for _ in range(CALLBACKS_PER_POLL):
                self._executor.spin_once(timeout_sec=0.0)
            status.show(describe(self.twist.logic), time.monotonic())

    @property
    def _is_finished(self) -> bool:
        """Whether no key can come any more and those from a pipe have had their effect."""
        if not self._reader.closed:
            return False
        logic = self.twist.logic
        is_moving = logic.is_moving and logic.keymap.mode == 'hold'
        return self._reader.terminal is not None or not is_moving

    def close(self) -> None:
        """Leave the robot stopped and release the nodes."""
        try:
            self.twist.close()
            self.keys.close()
        finally:
            self._executor.shutdown(timeout_sec=0.0)
            self.twist.destroy_node()
            self.keys.destroy_node()


def main(args: Sequence[str] | None = None) -> int:
    """Run `teleop`; return the exit status."""
    try:
        reader = open_key_reader()
    except NoTerminal as error:
        print(f'error: {error}', file=sys.stderr)
        return 2
    status = StatusLine(sys.stdout)
    with StopSignals() as stop, reader:
        teleop = None
        try:
            init_ros(args)
            teleop = Teleop(reader)
            print('\n'.join(teleop.twist.logic.keymap.help_lines), end='\n\n', flush=True)
            teleop.run(stop, status)
        except UserError as error:
            print(f'error: {error}', file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            # Ctrl-C again, because leaving took too long: nothing to explain.
            pass
        finally:
            if teleop is not None:
                teleop.close()
            rclpy.try_shutdown()
            status.close()
    return last_status(stop)


if __name__ == '__main__':
    sys.exit(main())
