# SPDX-License-Identifier: Apache-2.0
"""The node that relays one of several velocity commands, and the executable `twist_mux`."""

from collections.abc import Sequence
import dataclasses
import functools
import sys
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Bool, String
from visualization_msgs.msg import Marker
from wasd_core.parameters import InvalidParameter
from wasd_core.ros_parameters import declare_parameters
from wasd_core.topics import AbsenceWatch, LATCHED, RELIABLE, watch_types
from wasd_core.velocity_messages import twist_of

from teleop_keyboard.mux import (
    DEFAULT_LOCKS,
    DEFAULT_SOURCES,
    HIGHEST_PRIORITY,
    LONGEST_TIMEOUT,
    Mux,
    MuxInput,
)
from teleop_keyboard.parameters import MuxParameters, twist_mux
from teleop_keyboard.twist_messages import is_finite, to_marker, TwistOutput

# How often losses are looked for [s]: so late a zero comes after a time-out.
STEP_PERIOD = 0.02
# What the fields of the tables' rows mean.
ROW_FIELDS = {
    'topics': {
        'topic': "Topic of the source's velocities",
        'timeout': 'The source is lost after this silence; 0: never',
        'priority': 'The active source with the highest priority drives; 0: never',
    },
    'locks': {
        'topic': 'Topic; true closes the lock',
        'timeout': 'The lock closes after this silence; 0: it keeps its last value',
        'priority': 'A closed lock stops every source of a lower priority',
    },
}


class TwistMuxNode(Node):
    """
    Relays the source with the highest priority from its topic to `cmd_vel_out`.

    Sources and locks are twist_mux's parameters `topics.NAME.topic|timeout|priority` and
    `locks.NAME...`; a table that is not given is twist_mux's default. All send the type
    that the mux publishes. `selected` says who drives, `twist_marker` shows where to.

    Raises:
        InvalidParameter: a table cannot be used.
    """

    def __init__(self, *, parameter_overrides: list[Parameter] | None = None) -> None:
        super().__init__('twist_mux', parameter_overrides=parameter_overrides or [])
        self._settings = declare_parameters(self, MuxParameters, self._on_settings)
        self.output = TwistOutput(
            self, 'cmd_vel_out', self._settings.stamped, lambda: self._settings.frame_id
        )
        self._tables = {
            'topics': self._declare_table('topics', DEFAULT_SOURCES),
            'locks': self._declare_table('locks', DEFAULT_LOCKS),
        }
        self.mux = Mux(self._tables['topics'], self._tables['locks'])
        self.add_on_set_parameters_callback(self._on_parameters)
        self._selected = self.create_publisher(String, 'selected', LATCHED)
        self._marker = self.create_publisher(Marker, 'twist_marker', RELIABLE)
        self._announced: str | None = None
        self._absence = AbsenceWatch(self)
        for source in self._tables['topics']:
            # rclpy's types know no callback of two parameters.
            callback: Any = functools.partial(self._on_message, source.name)
            self.create_subscription(self.output.type, source.topic, callback, RELIABLE)
        topics = [source.topic for source in self._tables['topics']]
        watch_types(self, self.output.type, 'cmd_vel_out', *topics)
        self._lock_inputs = [
            self.create_subscription(
                Bool, lock.topic, functools.partial(self._on_lock, lock.name), RELIABLE
            )
            for lock in self._tables['locks']
        ]
        # Wall time: a paused simulation is no reason to ignore a lock.
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(STEP_PERIOD, self.step, clock=wall)
        self._announce()

    def step(self) -> None:
        """Look for losses; publish the zero that they call for."""
        if self.mux.step(self._now()):
            self._send(Twist())
        self._announce()

    def close(self) -> None:
        """Leave the robot stopped, if we are who drives it."""
        if self.mux.selected:
            self._send(Twist())
            self.output.see_off()

    def _now(self) -> float:
        """Return the node's time [s]: time-outs are simulated time where there is such."""
        return 1e-9 * self.get_clock().now().nanoseconds

    def _on_message(self, name: str, message: Twist | TwistStamped, info: dict[str, int]) -> None:
        # What waited while this node stood still says nothing of who drives now.
        if not self._absence.is_stale(info['source_timestamp']):
            self._on_twist(name, message)

    def _on_twist(self, name: str, message: Twist | TwistStamped) -> None:
        twist = twist_of(message)
        if not is_finite(twist):
            self.get_logger().warning(f'{name}: velocity is not finite: ignored', once=True)
            return
        if self.mux.offer(name, self._now()):
            self._send(twist)
        self._announce()

    def _on_lock(self, name: str, message: Bool) -> None:
        self.mux.lock(name, message.data, self._now())
        self.step()

    def _send(self, twist: Twist) -> None:
        self.output.publish(twist)
        self._marker.publish(
            to_marker(twist, self.get_clock().now().to_msg(), self._settings.frame_id)
        )

    def _announce(self) -> None:
        if self._announced != self.mux.selected:
            self._announced = self.mux.selected
            self._selected.publish(String(data=self._announced))

    def _declare_table(self, table: str, default: Sequence[MuxInput]) -> list[MuxInput]:
        """Declare the parameters of a table and return its rows."""
        given: dict[str, None] = {}
        for name in self._parameter_overrides:
            words = name.split('.')
            if len(words) == 3 and words[0] == table:
                given[words[1]] = None
        known = {row.name: row for row in default}
        rows = [known.get(name) or MuxInput(name=name, topic=name) for name in given]
        return [self._declare_row(table, row) for row in rows or default]

    def _declare_row(self, table: str, row: MuxInput) -> MuxInput:
        def declare(field: str, default: Any, words: str = '', **settings: Any) -> Any:
            # One descriptor each: rclpy writes the name into it.
            text = f'{ROW_FIELDS[table][field]}{words}'
            described = ParameterDescriptor(description=text, **settings)
            return self.declare_parameter(f'{table}.{row.name}.{field}', default, described).value

        topic = declare('topic', row.topic, read_only=True)
        # Our own check knows that 1 is a time, too, and says more of a range than ROS does.
        times = f' (float, >= 0 and <= {LONGEST_TIMEOUT:g} s)'
        timeout = declare('timeout', row.timeout, times, dynamic_typing=True)
        ranks = f' (0 .. {HIGHEST_PRIORITY})'
        priority = declare('priority', row.priority, ranks, dynamic_typing=True)
        return dataclasses.replace(row, topic=topic, timeout=timeout, priority=priority)

    def _on_settings(self, changed: MuxParameters) -> None:
        self._settings = changed

    def _on_parameters(self, changes: Sequence[Parameter]) -> SetParametersResult:
        tables = {name: {row.name: row for row in rows} for name, rows in self._tables.items()}
        try:
            for change in changes:
                words = change.name.split('.')
                if len(words) == 3 and words[0] in tables and words[1] in tables[words[0]]:
                    row = tables[words[0]][words[1]]
                    tables[words[0]][words[1]] = dataclasses.replace(
                        row, **{words[2]: change.value}
                    )
        except InvalidParameter as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._tables = {name: list(rows.values()) for name, rows in tables.items()}
        self.mux.configure(self._tables['topics'], self._tables['locks'])
        return SetParametersResult(successful=True)


if __name__ == '__main__':
    sys.exit(twist_mux())
