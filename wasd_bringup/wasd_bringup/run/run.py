# SPDX-License-Identifier: Apache-2.0
"""One run from start to end, without ROS: robots, drivers, keys, viewer, report."""

from collections.abc import Callable, Iterable
import math
import sys
import time
from typing import Any, TYPE_CHECKING

from mujoco_sim.sensors.cloud import CloudTag
from mujoco_sim.sensors.lidar import LidarTag
from mujoco_sim.world import World
from teleop_keyboard.dashboard import HELP_KEYS
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_script import KeyScriptWriter
from teleop_keyboard.screen import StatusLine
from wasd_core.errors import attempt_all
from wasd_core.timing import HELD, RELEASE, split_event, TWIST_RATE
from wasd_core.timing import LOST as LOST_KEY

from wasd_bringup.run.drivers import Driver, E_STOP, LOST, SCRIPTS
from wasd_bringup.run.face import Face
from wasd_bringup.run.inputs import (
    BoxPlayer,
    Command,
    END_E_STOP_KEY,
    KEY_LINE,
    MessageTimes,
    Player,
    RESET_KEY,
    SWITCH_KEY,
    SWITCH_LINE,
)
from wasd_bringup.run.options import AFTERGLOW, RunOptions
from wasd_bringup.run.report import join_reports, to_json
from wasd_bringup.run.robot import Robot
from wasd_bringup.run.show import show_robot
from wasd_bringup.run.worlds import build_robots

if TYPE_CHECKING:
    from mujoco_sim.viewer.views import View

    from wasd_bringup.run.guarding import RobotGuard
    from wasd_bringup.run.navigation import NavigationDriver
    from wasd_bringup.run.unitree import UnitreeDriver


class KeySwitch:
    """
    Sends each key to one of `count` robots: the one in turn, which SWITCH_KEY makes the next.

    A key that a source holds down at a switch belongs to its robot until it is let go: its repeats
    and its release reach that robot alone. A repeated SWITCH_KEY does nothing. `on_leave` get the
    number of the robot that the keys leave.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._owners: dict[tuple[str, str], int] = {}  # robots of held keys, by source and key
        self.active = 0
        self.on_leave: list[Callable[[int], None]] = []

    def receiver(self, key: str, by: str = 'keys') -> int | None:
        """Return the number of the robot that gets a source's key; None for SWITCH_KEY."""
        if self._count == 1:
            return 0
        event, base = split_event(key)
        held = by, base
        if base == SWITCH_KEY and not event and held not in self._owners:
            for tell in self.on_leave:
                tell(self.active)
            self.active = (self.active + 1) % self._count
        owner = self._owners.get(held, self.active)
        if event == RELEASE:
            self._owners.pop(held, None)
        elif event == HELD:
            self._owners[held] = owner
        return None if base == SWITCH_KEY else owner


class Run:
    """
    One or several robots, their drivers, and the loop that steps them.

    `run` returns when the duration is over or when `stop` says so; `close` leaves the robots
    stopped and the report written, in any case.

    `on_key` hear each key, `on_look` each look at the viewer (wall time, and time between two
    frames [s]), `on_loss` of its loss, `on_disarm` and `on_end` of these, `on_e_stop` of an e-stop
    before its keys are pressed.
    """

    def __init__(
        self,
        options: RunOptions,
        reader: KeyReader | None = None,
        visuals: bool = False,
        make_face: 'Callable[[Run], Face] | None' = None,
    ) -> None:
        """
        Load the robots and build everything; `visuals` are what viewers and pictures show.

        `make_face` shows the run to other processes: it may set parameters, and `join` drivers.

        Raises:
            UserError: an option is wrong; the text says how, in one line.
        """
        self.options = options
        self._reader = reader
        # Whether it does not end with its keys.
        self._is_endless = options.has_guests or options.duration != math.inf
        self.view: View | None = None  # shows it, `where` somebody looks; it is closed at the end
        self.where = ''
        self.on_key: list[Callable[[str], None]] = []
        self.on_look: list[Callable[[float, float], None]] = []
        self.on_loss: list[Callable[[], None]] = []
        self.on_disarm: list[Callable[[], None]] = []
        self.on_e_stop: list[Callable[[], None]] = []
        self.on_end: list[Callable[[], None]] = []
        # The words of the run that is to come in place of this one.
        self.next_words: tuple[str, ...] = ()
        self._wall_time = 0.0
        self._ended_at = math.inf
        self._status = StatusLine(sys.stdout)
        self._next_frame = 0.0
        self._message_times = MessageTimes()
        self._polled_at = time.monotonic()
        self.robots = build_robots(options, visuals)
        self.simulation = self.robots[0].simulation
        self.switch = KeySwitch(len(self.robots))
        self._writer = KeyScriptWriter(options.save_keys) if options.save_keys else None
        self._is_scheduled = False
        self.face = make_face(self) if make_face is not None else Face()
        for robot in self.robots:
            robot.on_e_stop = self.e_stop
            robot.prepare()
        self.guards = self._make_guards()
        self.navigations = self._make_navigations()
        self.interfaces = self._make_interfaces()
        self._drivers: list[Driver] = [*self.navigations, *self.interfaces]
        self.face.begin()
        self._schedule()

    def _make_guards(self) -> 'list[RobotGuard]':
        """Return a guard of each robot, if the options ask for it."""
        if not self.options.guard:
            return []
        # Here, because few runs need it.
        from wasd_bringup.run.guarding import RobotGuard

        return [RobotGuard(robot) for robot in self.robots]

    def _make_navigations(self) -> 'list[NavigationDriver]':
        """Return a navigator of each robot, if the options ask for a map."""
        if self.options.map is None:
            return []
        # Here, because few runs need it.
        from wasd_bringup.run.navigation import NavigationDriver

        made = [NavigationDriver(robot) for robot in self.robots]
        for navigation in made:
            self.face.show_navigation(navigation)
            navigation.prepare()
        self.switch.on_leave.append(lambda left: made[left].leave())
        return made

    def _make_interfaces(self) -> 'list[UnitreeDriver]':
        """Return Unitree's interface of each robot with legs, where it was asked for."""
        if self.options.interface is None or self.options.commands is not None:
            return []  # a recording has what programs did
        # Here, because few runs need it.
        from wasd_bringup.run.go2 import Go2
        from wasd_bringup.run.unitree import idle_guard, UnitreeDriver

        made = []
        for number, robot in enumerate(self.robots):
            if isinstance(robot, Go2):
                guard = self.guards[number] if self.guards else idle_guard(robot)
                made.append(UnitreeDriver(robot, guard=guard))
        return made

    @property
    def active(self) -> int:
        """The number of the robot that the keys drive."""
        return self.switch.active

    @property
    def robot(self) -> Robot:
        """The robot that the keys drive."""
        return self.robots[self.switch.active]

    @property
    def world(self) -> World:
        """Its world."""
        return self.robot.world

    @property
    def first_lines(self) -> list[str]:
        """The first lines for the user, few enough for a small window."""
        has_others = len(self.robots) > 1
        keys = [f'{r.name}: ' * has_others + r.first_keys for r in self.robots]
        drivers = dict.fromkeys(driver.first_line for driver in self._drivers)
        return [*self._where_lines, *keys, *drivers, *self._run_lines]

    @property
    def _run_lines(self) -> list[str]:
        return [KEY_LINE] if len(self.robots) == 1 else [SWITCH_LINE, KEY_LINE]

    @property
    def _where_lines(self) -> list[str]:
        return [f'viewer: {self.where}'] if self.where else []

    def run(self, stop: Any) -> None:
        """Simulate until the duration is over, the keys end, or `stop` is called."""
        started = time.monotonic()
        try:
            self.simulation.run(
                stop=lambda: stop.requested or self._keys_ended() or bool(self.next_words),
                poll=self._poll,
                each_second=self.face.each_second,
                duration=self.options.duration,
                may_advance=lambda: all(each.may_advance() for each in self.interfaces),
            )
        finally:
            self._wall_time += time.monotonic() - started

    def stop(self) -> None:
        """Stop every robot, and publish that now: there may be no next time step."""
        self.disarm()
        for robot in self.robots:
            robot.stop()
        self.face.flush()

    def disarm(self) -> None:
        """Ignore what any source holds now, until it is released and pressed again."""
        for robot in self.robots:
            robot.disarm()
        for let_go in self.on_disarm:
            let_go()
        for driver in self._drivers:
            driver.disarm()

    def e_stop(self, by: str) -> None:
        """
        Stop every robot for a source, and end all scripts; with `--latched` until the release.

        A script that stops the robots itself goes on.
        """
        self.disarm()
        if by not in SCRIPTS:
            self._key_player, self._commands = Player(()), Player(())
        for tell in self.on_e_stop:
            tell()
        for number, robot in enumerate(self.robots):
            robot.e_stop(by)
            self.press_for(number, robot.stop_keys, E_STOP)

    def end_e_stop(self) -> bool:
        """Release a latched stop; return whether one held."""
        held = any(robot.stop_words for robot in self.robots)
        for robot in self.robots:
            robot.end_e_stop()
        return held

    @property
    def has(self) -> dict[str, bool]:
        """What there is of what some options need."""
        tags = [tag for robot in self.robots for tag in robot.sensors.tags]
        return {
            'lidar': any(isinstance(tag, (LidarTag, CloudTag)) for tag in tags),
            'physics': not all(robot.options.is_fake for robot in self.robots),
        }

    def join(self, driver: Driver) -> None:
        """Add a driver; the run calls it like the others, and closes it at the end."""
        self._drivers.append(driver)
        if self._is_scheduled:
            self.simulation.schedule.every(1.0 / TWIST_RATE, driver.repeat)

    def resume(self) -> None:
        """Continue after a suspension, which does not count as elapsed time."""
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
        Stop the robots, write the report, release everything, also after an error.

        Raises:
            UserError: a file was not written; one line each.
        """
        attempt_all(
            *(driver.close for driver in self._drivers),
            *(robot.close for robot in self.robots),
            self._status.close,
            *([self._writer.close] if self._writer is not None else []),
            self._write_report,
            self._release,
        )

    def _write_report(self) -> None:
        if self.options.report is not None:
            self.options.report.write(to_json(self.report()))

    def _release(self) -> None:
        for close in self.on_end:
            close()
        if self.view is not None:
            self.view.close()
        self.face.close()

    def _schedule(self) -> None:
        """Set the order in a time step: time, scripts, controllers, publishers, report."""
        schedule = self.simulation.schedule
        options = self.options
        self._key_player = Player(options.keys or ())
        commands = options.commands or ()
        self._commands = Player(commands)
        step = self.world.time_step
        steps = {round(each.time / step) for each in commands if each.event == 'step'}
        self.simulation.hand_steps.extend(sorted(steps - {0}))
        self._boxes = BoxPlayer(options.boxes, self.world.physics.boxes.put)
        self._next_event = -math.inf
        period = min(robot.period for robot in self.robots)
        schedule.at_rate('update_rate', 1.0 / period, self._begin_instant, self._rest)
        schedule.every(1.0 / TWIST_RATE, self._look_who_drives)
        for driver in self._drivers:
            schedule.every(1.0 / TWIST_RATE, driver.repeat)
        for robot in self.robots:
            robot.schedule_control(schedule)
            self.face.schedule_control(robot, schedule)
        for robot in self.robots:
            robot.schedule_sensing(schedule)
            self.face.schedule_sensing(robot, schedule)
        self._is_scheduled = True

    def _begin_instant(self) -> None:
        instant = self.world.time
        self.face.begin_instant()
        for robot in self.robots:
            robot.begin_instant(instant)
        if instant >= self._next_event:
            self._play(instant)

    def _rest(self) -> float:
        """Return for how long from now [s] no script has anything to do."""
        events = (self._next_event, *(robot.pushes.next_time for robot in self.robots))
        return min(events) - self.world.time

    def _play(self, instant: float) -> None:
        """Do what scripts say is due at a simulated time [s]."""
        for box in self._boxes.step(instant):
            self.robot.say(f'no box at {box.x:g} {box.y:g}: a robot is there')
        for command in self._commands.due(instant):
            self._repeat(command)
        for press in self._key_player.due(instant):
            self.press(press.key, 'script')
        players = self._boxes, self._commands, self._key_player
        self._next_event = min(player.next_time for player in players)

    def _look_who_drives(self) -> None:
        """Release silent sources, and publish who drives."""
        pacer = self.simulation.pacer
        haste = max(pacer.speed or pacer.real_time_factor, 1.0)
        for robot in self.robots:
            robot.drivers.step(1.0 / TWIST_RATE, haste)
        self.face.look_who_drives()

    def _repeat(self, command: Command) -> None:
        """Repeat the events of a recording."""
        if command.event == 'reset':
            self.simulation.reset()
        elif command.event == 'e-stop':
            for robot in self.robots:
                robot.let_go()
        for robot in self.robots:
            if robot.options.namespace != command.namespace:
                continue
            # The others have only become velocities.
            if command.key is not None and robot.has_states:
                robot.press(command.key, 'recording')
            elif command.velocity is not None:
                robot.drive(command.velocity, 'recording', command.age)

    def press(self, key: str, by: str = 'keys', to: int | None = None) -> None:
        """Give a source's key to the robot of number `to`, or to the one that `switch` names."""
        for note in self.on_key:
            note(key)
        if self._writer is not None:
            # The key is in force from the next instant on.
            self._writer.write(self.world.time, key)
        if self._is_for_the_run(key, by):
            return
        receiver = self.switch.receiver(key, by) if to is None else to
        if receiver is not None:
            self.robots[receiver].press(key, by)
        elif self.view is not None:
            self.view.follow(self.world)

    def _is_for_the_run(self, key: str, by: str) -> bool:
        """Handle a key of the run itself; False for any other key."""
        robot = self.robot
        if key == END_E_STOP_KEY and robot.drivers.stopped_by:
            # Refused until its release: a keymap may drive by it.
            robot.drivers.take(by, key=key)
            self.end_e_stop()
            return True
        if key in robot.own_keys:
            return False
        if key == RESET_KEY:
            # As by the simulator's service: once for the world, and a recording knows of it.
            self.simulation.reset()
            robot.say('back at the start')
            return True
        if key in HELP_KEYS:
            # The address last: it is to stay in sight.
            self._status.print([*robot.help_lines, *self._run_lines, *self._where_lines])
            robot.say('the keys stand above (on the page: under Keys)')
            return True
        return False

    def _poll(self, timeout: float) -> None:
        """Handle everything on wall time: keys, messages, the page, the status."""
        if self._reader is not None and not self._reader.closed:
            with self._reader.undisturbed():
                for key in self._reader.poll(timeout):
                    self.press(key)
            if notice := self._reader.take_notice():
                self.robot.say(notice)
            timeout = 0.0
            if self._reader.closed:
                if self._reader.terminal is not None:
                    # Nobody reads it any more: Ctrl-C shall be a signal, not a sequence.
                    self._reader.terminal.switch_off()
                if self.options.has_guests:  # else the run ends soon
                    self._stop_what_moved('keys', 'its keys have ended')
        for driver in self._drivers:
            driver.look()
        now = time.monotonic()
        if timeout > 0.0 or self._message_times.is_due(now, self.world.time):
            started = now
            self.face.handle(timeout)
            now = time.monotonic()
            took = now - started if timeout == 0.0 else 0.0
            self._message_times.looked(now, took, self.world.time)
        if self.view is not None:
            self._look_at_view(self.view, now)
        self.face.save()
        for robot in self.robots:
            robot.notice.step(now - self._polled_at)
        self._polled_at = now
        name = self.robot.name if len(self.robots) > 1 else ''
        is_told = self._reader is not None and not self.options.prints_data
        show_robot(self.robot, self._status, name, now, is_told)

    def _look_at_view(self, view: 'View', now: float) -> None:
        """Show the present state, and handle the viewer's keys and orders."""
        if now >= self._next_frame:
            self._next_frame = now + view.period
            view.sync(self.simulation.pacer.is_hurried and not self.simulation.paused)
            for key in view.pressed_keys():
                if key == LOST_KEY:
                    self._stop_what_the_view_moved()
                else:
                    self.press(key, 'page')
        for look in self.on_look:
            look(now, view.period)

    def _stop_what_the_view_moved(self) -> None:
        """Stop motion by keys and goals of a lost viewer."""
        self._stop_what_moved('page', 'the viewer that drove it is gone')
        for let_go in self.on_loss:
            let_go()
        for each in self.navigations:
            each.lose_page()

    def _stop_what_moved(self, source: str, why: str) -> None:
        for robot in self.robots:
            if any(robot.drivers.held(source)):
                self.lose(source, robot, why)

    def lose(self, source: str, robot: Robot, why: str) -> None:
        """Stop a robot whose source is gone, by a key as a driver would."""
        self.press_for(self.robots.index(robot), (robot.stop_key,), LOST)
        robot.release(source)
        robot.say(f'it was stopped ({why})')

    def press_for(self, robot: int, keys: Iterable[str], by: str) -> None:
        """Give keys to a robot, by its number, also if it is not selected."""
        driven = self.switch.active
        self.switch_to(robot)
        for key in keys:
            self.press(key, by, robot)
        self.switch_to(driven)

    def switch_to(self, robot: int) -> None:
        """Let the keys drive a robot, by its number."""
        while self.switch.active != robot:
            self.press(SWITCH_KEY, 'run')  # whoever holds that key down

    def _keys_ended(self) -> bool:
        """Whether the pipe that gave the keys has ended and the robot has had time to stop."""
        if self._reader is None or self._is_endless:
            return False
        if self._reader.closed and self._ended_at == math.inf:
            self._ended_at = self.world.time
        return self.world.time > self._ended_at + AFTERGLOW
