# SPDX-License-Identifier: Apache-2.0
"""One run from start to end: robots, nodes in lock-step, keys, viewer, report."""

from collections.abc import Iterable
import math
import sys
import time
from typing import Any, cast, TYPE_CHECKING

from mujoco_sim.viewer.input import LOST as LOST_KEY
from mujoco_sim.viewer.views import View
from mujoco_sim.world import World
from rclpy.clock import ClockType, ROSClock
from rclpy.node import Node
from rclpy.time import Time
from rclpy.time_source import TimeSource
from teleop_keyboard.dashboard import HELP_KEYS
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_script import KeyScriptWriter
from teleop_keyboard.screen import StatusLine
from wasd_core.errors import attempt_all
from wasd_core.node import MessagePump

from wasd_bringup.inputs import (
    BoxPlayer,
    Command,
    E_STOP_KEY,
    END_E_STOP_KEY,
    KEY_LINE,
    KeySwitch,
    MessageTimes,
    Player,
    RESET_KEY,
    SWITCH_KEY,
    SWITCH_LINE,
    TWIST_RATE,
)
from wasd_bringup.options import AFTERGLOW, RunOptions
from wasd_bringup.report import join_reports, write_report
from wasd_bringup.run.drivers import E_STOP, LOST
from wasd_bringup.session_guests import Guest, make_guests, make_navigations, Told
from wasd_bringup.session_robot import build_robots, SessionRobot
from wasd_bringup.stack import ControlStack

if TYPE_CHECKING:
    from wasd_bringup.recording.recorder import BagRecorder
    from wasd_bringup.session_foxglove import FoxgloveServer


class Session:
    """
    All nodes of one robot or several in this process, and the loop that steps them.

    rclpy must be initialised. `run` returns when the duration is over or when `stop` says so;
    `close` leaves the robots stopped, the report written and the nodes gone, in any case.
    """

    def __init__(
        self,
        options: RunOptions,
        reader: KeyReader | None = None,
        visuals: bool = False,
        recorder: 'BagRecorder | None' = None,
        foxglove: 'FoxgloveServer | None' = None,
    ) -> None:
        """
        Load the robots and build everything; `visuals` are what viewers and pictures show.

        `recorder` and `foxglove` are told the simulated time; their maker closes them afterwards.

        Raises:
            UserError: what is wrong with what was asked for, in one line.
        """
        self.options = options
        self._reader = reader
        self._bag = recorder
        self._view: View | None = None
        self._where = ''  # it is
        self.told = Told()
        # The words of the run that is to come in place of this one.
        self.next_words: tuple[str, ...] = ()
        self._wall_time = 0.0
        self._ended_at = math.inf
        self._status = StatusLine(sys.stdout)
        self._next_frame = 0.0
        self._message_times = MessageTimes()
        self._polled_at = time.monotonic()
        self.robots = build_robots(options, visuals)
        self.simulation = self.robots[0].simulator.simulation
        self._switch = KeySwitch(len(self.robots))
        self._writer = KeyScriptWriter(options.save_keys) if options.save_keys else None
        self._nodes: list[Node] = [node for robot in self.robots for node in robot.nodes]
        self.navigations = make_navigations(options, self.robots, self._switch)
        self._guests = make_guests(
            options, self.robots, self._switch, self.press, foxglove, self.navigations
        )
        self._nodes += [node for guest in self._guests for node in guest.nodes]
        self._obey_e_stops()
        self._pump = MessagePump()
        self._clocks = [cast(ROSClock, node.get_clock()) for node in self._nodes]
        self._attach_nodes()
        self._schedule()
        self.simulation.on_reset += [robot.stack.reset for robot in self.robots]
        self.simulation.on_reset += [robot.drivers.reset for robot in self.robots]
        if recorder is not None:
            recorder.now = lambda: round(self.world.time * 1e9)
            self.simulation.on_reset.append(lambda: recorder.event('reset'))

    def _obey_e_stops(self) -> None:
        """Let an e-stop of one robot, by topic or service, stop all robots."""
        for robot in self.robots:
            robot.driver_topic.on_stop = self.e_stop
            robot.driver_topic.on_release = self.end_e_stop
            robot.stack.on_e_stop(lambda: self.e_stop('service e_stop'))

    def _attach_nodes(self) -> None:
        """Have messages for the nodes handled by us, and their clocks tell simulated time."""
        time_source = TimeSource()
        time_source.ros_time_is_active = True
        for node, clock in zip(self._nodes, self._clocks, strict=True):
            self._pump.add_node(node)
            time_source.attach_clock(clock)

    @property
    def active(self) -> int:
        """The number of the robot that the keys drive."""
        return self._switch.active

    @property
    def robot(self) -> SessionRobot:
        """The robot that the keys drive."""
        return self.robots[self._switch.active]

    @property
    def world(self) -> World:
        """Its world."""
        return self.robot.world

    @property
    def stack(self) -> ControlStack:
        """Its nodes that drive."""
        return self.robot.stack

    @property
    def first_lines(self) -> list[str]:
        """What a driver must know to begin: few lines, which leave room for what comes."""
        has_others = len(self.robots) > 1
        keys = [f'{r.name}: ' * has_others + r.stack.first_keys for r in self.robots]
        guests = dict.fromkeys(guest.first_line for guest in self._guests)
        return [*self._where_lines, *keys, *guests, *self._run_lines]

    @property
    def _run_lines(self) -> list[str]:
        return [KEY_LINE] if len(self.robots) == 1 else [SWITCH_LINE, KEY_LINE]

    @property
    def _where_lines(self) -> list[str]:
        return [f'viewer: {self._where}'] if self._where else []

    def take_view(self, view: View, where: str) -> None:
        """Be shown by a viewer, and say where it is; it is closed with the session."""
        self._view, self._where = view, where

    def run(self, stop: Any) -> None:
        """Simulate until the duration is over, the keys have ended, or `stop` is requested."""
        started = time.monotonic()
        try:
            self.simulation.run(
                stop=lambda: stop.requested or self._keys_ended() or bool(self.next_words),
                poll=self._poll,
                each_second=self._each_second,
                duration=self.options.duration,
            )
        finally:
            self._wall_time += time.monotonic() - started

    def stop(self) -> None:
        """Stop every robot, and say so now: there may be no next instant."""
        self.disarm()
        for robot in self.robots:
            robot.stack.stop()

    def disarm(self) -> None:
        """Let nothing that any source holds now count, until it is released and pressed again."""
        for robot in self.robots:
            robot.disarm()
        for let_go in self.told.to_let_go:
            let_go()
        for guest in self._guests:
            guest.disarm()

    def e_stop(self, by: str) -> None:
        """Stop every robot for good, for a source; with `--latched` until it is released."""
        self.disarm()
        for number, robot in enumerate(self.robots):
            robot.e_stop(by)
            self.press_for(number, robot.stack.stop_keys, E_STOP)

    def end_e_stop(self) -> None:
        """End a stop that holds."""
        for robot in self.robots:
            robot.end_e_stop()

    def join(self, guest: Guest) -> None:
        """Let one more drive: it is asked as those of the options are, and closed at the end."""
        self._guests.append(guest)
        self.simulation.schedule.every(1.0 / TWIST_RATE, guest.repeat)

    def resume(self) -> None:
        """Go on after a suspension: it was no time that anything took."""
        self.simulation.pacer.restart()
        self._next_frame = 0.0
        self._message_times = MessageTimes()
        self._status.refresh()

    def report(self) -> dict[str, Any]:
        """Return the report of the run so far."""
        parts = [{'navigation': each.report()} for each in self.navigations]
        reports = [
            robot.report(self._wall_time, **(parts[number] if parts else {}))
            for number, robot in enumerate(self.robots)
        ]
        return reports[0] if len(reports) == 1 else join_reports(reports)

    def close(self) -> None:
        """
        Stop the robots, write the report, release everything; what fails hinders nothing else.

        Raises:
            UserError: what could not be written, a line each.
        """
        attempt_all(
            *(guest.close for guest in self._guests),
            *(robot.stack.close for robot in self.robots),
            self._status.close,
            *([self._writer.close] if self._writer is not None else []),
            self._write_report,
            self._release,
        )

    def _write_report(self) -> None:
        if self.options.report is not None:
            write_report(self.report(), self.options.report)

    def _release(self) -> None:
        for close in self.told.of_the_end:
            close()
        if self._view is not None:
            self._view.close()
        for robot in self.robots:
            robot.close()
        self._pump.shutdown(timeout_sec=0.0)
        for node in self._nodes:
            node.destroy_node()

    def _schedule(self) -> None:
        """Fix the order of one instant: time, scripts, controllers, publishers, report."""
        schedule = self.simulation.schedule
        options = self.options
        self._key_player = Player(options.keys or ())
        self._commands = Player(options.commands or ())
        self._boxes = BoxPlayer(options.boxes, self.world.boxes.put)
        schedule.every(min(robot.stack.period for robot in self.robots), self._begin_instant)
        schedule.every(1.0 / TWIST_RATE, self._look_who_drives)
        for guest in self._guests:
            schedule.every(1.0 / TWIST_RATE, guest.repeat)
        for robot in self.robots:
            robot.schedule_control(schedule)
        for robot in self.robots:
            robot.schedule_publishing(schedule)

    def _begin_instant(self) -> None:
        instant = self.world.time
        now = Time(nanoseconds=round(1e9 * instant), clock_type=ClockType.ROS_TIME)
        for clock in self._clocks:
            clock.set_ros_time_override(now)
        for robot in self.robots:
            robot.begin_instant()
        for box in self._boxes.step(instant):
            self.stack.notice.say(f'no box at {box.x:g} {box.y:g}: a robot is there')
        for command in self._commands.due(instant):
            self._repeat(command)
        for press in self._key_player.due(instant):
            self.press(press.key, 'script')

    def _look_who_drives(self) -> None:
        """Let who is silent let go, and tell who drives."""
        # A hand is no faster because time is.
        passed = 1.0 / (TWIST_RATE * max(self.options.speed, 1.0))
        for robot in self.robots:
            robot.drivers.step(passed)
            robot.driver_topic.tell(robot.drivers.state)

    def _repeat(self, command: Command) -> None:
        """Do what a recording says was done."""
        if command.key is None and command.velocity is None:
            self.simulation.reset()
        for robot in self.robots:
            if robot.options.namespace != command.namespace:
                continue
            # Keys that only became velocities are not to become some again.
            if command.key is not None and robot.stack.has_states:
                robot.press(command.key, 'recording')
            elif command.velocity is not None:
                robot.drive(command.velocity, 'recording')

    def press(self, key: str, by: str = 'keys') -> None:
        """Give a key of a source to the robot that it is for."""
        for note in self.told.of_keys:
            note(key)
        if self._writer is not None:
            # At the instant that it is in force from: the one that comes next.
            self._writer.write(self.world.time, key)
        if self._is_for_the_run(key, by):
            return
        receiver = self._switch.receiver(key)
        if receiver is not None:
            self.robots[receiver].press(key, by)
        elif self._view is not None:
            self._view.follow(self.world)

    def _is_for_the_run(self, key: str, by: str) -> bool:
        """Do what a key of the run itself asks for; False when it is no such key."""
        stack = self.stack
        if key in stack.own_keys:
            return False
        if key == E_STOP_KEY:
            self.e_stop(by)
            return True
        if key == END_E_STOP_KEY and self.robot.drivers.stopped_by:
            self.end_e_stop()
            return True
        if key == RESET_KEY:
            # As by the simulator's service: once for the world, and a recording knows of it.
            self.simulation.reset()
            stack.notice.say('back at the start')
            return True
        if key in HELP_KEYS:
            # The address last: it is to stay in sight.
            self._status.print([*stack.help_lines, *self._run_lines, *self._where_lines])
            stack.notice.say('the keys stand above (on the page: under Keys)')
            return True
        return False

    def _poll(self, timeout: float) -> None:
        """Look after everything that lives on wall time: keys, messages, the page, the status."""
        if self._reader is not None and not self._reader.closed:
            with self._reader.undisturbed():
                for key in self._reader.poll(timeout):
                    self.press(key)
            if notice := self._reader.take_notice():
                self.stack.notice.say(notice)
            timeout = 0.0
        for guest in self._guests:
            guest.look()
        now = time.monotonic()
        if timeout > 0.0 or self._message_times.is_due(now, self.world.time):
            started = now
            self._pump.handle(timeout)
            now = time.monotonic()
            took = now - started if timeout == 0.0 else 0.0
            self._message_times.looked(now, took, self.world.time)
        if self._view is not None:
            self._look_at_view(self._view, now)
        if self._bag is not None:
            self._bag.save_if_due()
        self._let_notices_age(now)
        name = self.robot.name if len(self.robots) > 1 else ''
        is_told = self._reader is not None and not self.options.prints_data
        self.robot.show(self._status, name, now, is_told)

    def _look_at_view(self, view: View, now: float) -> None:
        """Show the state of now, and do what was pressed and ordered there."""
        if now >= self._next_frame:
            self._next_frame = now + view.period
            view.sync(self.simulation.pacer.is_hurried and not self.simulation.paused)
            for key in view.pressed_keys():
                if key == LOST_KEY:
                    self._stop_what_the_view_moved()
                else:
                    self.press(key, 'page')
        for look in self.told.of_looks:
            look(now, view.period)

    def _stop_what_the_view_moved(self) -> None:
        """Stop what moves by keys and goals of a viewer that is gone: keys as a driver would."""
        for number, robot in enumerate(self.robots):
            if robot.drivers.moves('page'):
                self.press_for(number, (robot.stack.stop_key,), LOST)
                robot.release('page')
                robot.stack.notice.say('it was stopped (the viewer that drove it is gone)')
        for each in self.navigations:
            each.lose_page()

    def press_for(self, robot: int, keys: Iterable[str], by: str) -> None:
        """Give keys to a robot, by its number, whichever is in turn: as a driver would."""
        driven = self._switch.active
        self.switch_to(robot)
        for key in keys:
            self.press(key, by)
        self.switch_to(driven)

    def switch_to(self, robot: int) -> None:
        """Let the keys drive a robot, by its number."""
        while self._switch.active != robot:
            self.press(SWITCH_KEY)

    def _each_second(self) -> None:
        for robot in self.robots:
            robot.publish_diagnostics()

    def _keys_ended(self) -> bool:
        """Whether the pipe that gave the keys has ended and the robot has had time to stop."""
        is_endless = self.options.has_guests or self.options.duration != math.inf
        if self._reader is None or is_endless:
            return False
        if self._reader.closed and self._ended_at == math.inf:
            self._ended_at = self.world.time
        return self.world.time > self._ended_at + AFTERGLOW

    def _let_notices_age(self, now: float) -> None:
        """Let what is said to the driver grow old on the driver's time: wall time."""
        for robot in self.robots:
            robot.stack.notice.step(now - self._polled_at)
        self._polled_at = now
