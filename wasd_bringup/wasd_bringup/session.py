# SPDX-License-Identifier: Apache-2.0
"""One run from start to end: robot, world, nodes in lock-step, keys, viewer, report."""

import math
import sys
import time
from typing import Any, Protocol

from mujoco_sim.loading import build_world
from mujoco_sim.loading import load_robot
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.usual_setup import usual_setup
from mujoco_sim.viewer import Panel
from mujoco_sim.viewer import WebView
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time_source import TimeSource
from robot_description.node_support import MessagePump
from robot_description.state_publisher_node import StatePublisherNode
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from teleop_keyboard.key_publisher_node import KeyPublisherNode
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_script import KeyScriptWriter
from teleop_keyboard.status_line import StatusLine

from wasd_bringup.bag_recorder import BagRecorder
from wasd_bringup.drive_mode import is_fake
from wasd_bringup.options import AFTERGLOW
from wasd_bringup.options import RunOptions
from wasd_bringup.report import build_report
from wasd_bringup.report import Recorder
from wasd_bringup.report import SAMPLE_PERIOD
from wasd_bringup.report import write_report
from wasd_bringup.scripts import Player
from wasd_bringup.scripts import TWIST_RATE
from wasd_bringup.scripts import TwistPlayer
from wasd_bringup.stack import make_stack

# The page gets so many pictures a second of wall time.
FRAME_PERIOD = 1.0 / 60.0
# Messages and services are looked after so often [s of wall time].
MESSAGE_PERIOD = 0.02


class View(Protocol):
    """What a session needs of a viewer."""

    def sync(self) -> None:
        """Show the state of now."""

    def pressed_keys(self) -> list[str]:
        """Return the keys pressed in the viewer since the last call."""

    def close(self) -> None:
        """End it."""


class Session:
    """
    All nodes of one robot in this process, and the loop that steps them.

    rclpy must be initialised. `run` returns when the duration is over or when `stop` says so;
    `close` leaves the robot stopped, the report written and the nodes gone, in any case.
    """

    def __init__(
        self,
        options: RunOptions,
        reader: KeyReader | None = None,
        visuals: bool = False,
        recorder: BagRecorder | None = None,
    ) -> None:
        """
        Load the robot and build everything; `visuals` are what viewers and pictures show.

        A `recorder` is told the simulated time; whoever made it closes it after the session.

        Raises:
            UserError: what is wrong with what was asked for, in one line.
        """
        self._options = options
        self._reader = reader
        self._bag = recorder
        self._view: View | None = None
        self._nodes: list[Node] = []
        self._wall_time = 0.0
        self._ended_at = math.inf
        self._status = StatusLine(sys.stdout)
        self._next_frame = self._next_messages = 0.0
        loaded = load_robot(
            options.description, options.package_path, options.xacro_arguments, options.strict
        )
        for line in loaded.repairs:
            print(f'description: {line}', file=sys.stderr)
        self._loaded = loaded
        setup = usual_setup(loaded.robot, noise=options.estimator == 'kalman')
        built = loaded.with_stand_in_masses() if is_fake(options) else loaded
        self.world = build_world(built, options.world, options.seed, setup, visuals)
        self.simulator = SimulatorNode(
            loaded, self.world, lock_step=True, parameter_overrides=_overrides(options)
        )
        self._nodes.append(self.simulator)
        self.simulation = self.simulator.simulation
        self.stack = make_stack(loaded, self.world, options)
        self._state_publisher = StatePublisherNode(loaded.urdf, lock_step=True)
        self._keys = KeyPublisherNode()
        self._keys.receivers.append(self.stack.press)
        self._writer = KeyScriptWriter(options.save_keys) if options.save_keys else None
        if self._writer is not None:
            self._keys.receivers.append(self._save)
        self._nodes += [*self.stack.nodes, self._state_publisher, self._keys]
        self._pump = MessagePump()
        self._time_source = TimeSource()
        self._time_source.ros_time_is_active = True
        for node in self._nodes:
            self._pump.add_node(node)
            self._time_source.attach_clock(node.get_clock())
        self._recorder = Recorder(self.world)
        self._schedule()
        self.simulation.on_reset.append(self.stack.reset)
        if recorder is not None:
            recorder.now = lambda: round(self.world.time * 1e9)
            self.simulation.on_reset.append(lambda: recorder.event('reset'))

    def open_view(self, kind: str) -> str:
        """
        Start a viewer, `web`, `native` or `none`; return where it is.

        Raises:
            SimulationError: the port is taken, or there is no display.
        """
        if kind == 'web':
            panel = Panel(self._status_words, ['Click the scene first.', *self.stack.help_lines])
            web = WebView(self.world, self.stack.camera, panel, port=self._options.port)
            self._view = web
            return web.url
        if kind == 'native':
            # Here, because it loads a window system.
            from mujoco_sim.native_viewer import NativeView

            self._view = NativeView(self.world, self.stack.camera)
            return 'a window on this display'
        return ''

    def run(self, stop: Any) -> None:
        """Simulate until the duration is over, the keys have ended, or `stop` is requested."""
        started = time.monotonic()
        try:
            self.simulation.run(
                stop=lambda: stop.requested or self._keys_ended(),
                poll=self._poll,
                each_second=self._each_second,
                duration=self._options.duration,
            )
        finally:
            self._wall_time += time.monotonic() - started

    def report(self) -> dict[str, Any]:
        """Return the report of the run so far."""
        options = self._options
        asked = {
            'robot': options.robot,
            'description': self._loaded.record(),
            'world': options.world,
            'seed': options.seed,
            'estimator': self.stack.estimator,
        }
        return build_report(
            self._recorder, asked, self.world.time, self._wall_time, self.stack.ticks.summary()
        )

    def close(self) -> None:
        """Stop the robot, write the report, release everything."""
        try:
            self.stack.close()
            self._status.close()
            if self._writer is not None:
                self._writer.close()
            if self._options.report is not None:
                write_report(self.report(), self._options.report)
        finally:
            if self._view is not None:
                self._view.close()
            self.simulator.close()
            self._pump.shutdown(timeout_sec=0.0)
            for node in self._nodes:
                node.destroy_node()

    def _schedule(self) -> None:
        """Fix the order of one instant: time, scripts, controllers, publishers, report."""
        options, schedule = self._options, self.simulation.schedule
        self._key_player = Player(options.keys or ())
        self._push_player = Player(options.pushes)
        twists = TwistPlayer(options.twists or (), self.stack.drive)
        schedule.every(self.stack.period, self._begin_instant)
        if options.twists is not None:
            schedule.every(1.0 / TWIST_RATE, lambda: twists.step(self.world.time))
        self.stack.schedule(schedule)
        self.simulator.schedule_publishing()
        state_period = 1.0 / self.simulator.settings.state_rate
        schedule.every(state_period, self._publish_transforms)
        schedule.every(state_period, lambda: self.simulator.truth.compare(self.stack.odometry))
        schedule.every(SAMPLE_PERIOD, lambda: self._recorder.sample(self.stack.sample()))

    def _begin_instant(self) -> None:
        now = self.world.time
        self._time_source.clock_callback(Clock(clock=self.simulator.stamp))
        for push in self._push_player.due(now):
            self.world.push(push.force, push.duration)
        for press in self._key_player.due(now):
            self._keys.publish_key(press.key)

    def _publish_transforms(self) -> None:
        joints = self.world.joints()
        stamp = self.simulator.stamp
        self._state_publisher.publish(self.world.joint_names, joints.position, stamp)

    def _save(self, message: String) -> None:
        """Write a key at the instant that it is in force from: the one that comes next."""
        if self._writer is not None:
            self._writer.write(self.world.time, message.data)

    def _poll(self, timeout: float) -> None:
        """Look after everything that lives on wall time: keys, messages, the page, the status."""
        if self._reader is not None and not self._reader.closed:
            for key in self._reader.poll(timeout):
                self._keys.publish_key(key)
            timeout = 0.0
        now = time.monotonic()
        if timeout > 0.0 or now >= self._next_messages:
            self._pump.handle(timeout)
            now = time.monotonic()
            self._next_messages = now + MESSAGE_PERIOD
        if self._view is not None and now >= self._next_frame:
            self._next_frame = now + FRAME_PERIOD
            self._view.sync()
            for key in self._view.pressed_keys():
                self._keys.publish_key(key)
        if self._bag is not None:
            self._bag.save_if_due()
        self._status.show('  '.join(self._status_words()), now)

    def _each_second(self) -> None:
        self.simulator.publish_diagnostics(self.stack.state, self.stack.ticks)

    def _keys_ended(self) -> bool:
        """Whether the pipe that gave the keys has ended and the robot has had time to stop."""
        if self._reader is None or self._options.duration != math.inf:
            return False
        if self._reader.closed and self._ended_at == math.inf:
            self._ended_at = self.world.time
        return self.world.time > self._ended_at + AFTERGLOW

    def _status_words(self) -> list[str]:
        factor = self.simulation.pacer.real_time_factor
        pace = 'paused' if self.simulation.paused else f'x{factor:.2f}'
        return [*self.stack.status(), f'{self.world.time:.1f} s {pace}']


def _overrides(options: RunOptions) -> list[Parameter]:
    return [
        Parameter('description', value=options.description),
        Parameter('world', value=options.world),
        Parameter('seed', value=options.seed),
        Parameter('speed', value=options.speed),
    ]
