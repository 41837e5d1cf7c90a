# SPDX-License-Identifier: Apache-2.0
"""One robot of a run, without ROS: its part of the world, controller and drivers."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
import dataclasses
import functools
import logging
import time
from typing import Any

from mujoco_sim.parameters import SHOWN_RATE, SimulatorParameters
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.simulation import Schedule, Simulation, TickStatistics
from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.world import World
import numpy as np
from robot_description.description import Description
from teleop_keyboard.dashboard import Axis, Status
from teleop_keyboard.key_script import script_word
from teleop_keyboard.keymap import on_layout
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_cockpit.link import Choice
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry
from wasd_core.timing import HELD, Notice, split_event, STOP_KEY, TWIST_RATE

from wasd_bringup.robots import ROBOTS
from wasd_bringup.run.drivers import Drivers, E_STOP, Held, LOST, SILENCE
from wasd_bringup.run.inputs import E_STOP_KEY, Player, TwistPlayer
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.report import build_report, Recorder, Sample, SAMPLE_PERIOD

Velocity = tuple[float, float, float]
# A velocity ahead, to the left and up [m/s], and a turn [rad/s], as it is told.
FullVelocity = tuple[float, float, float, float]

STANDSTILL = (0.0, 0.0, 0.0)
# The sender may not know that the robot was stopped.
REFUSED = 'stop the publisher of {}, or send a zero'
LET_GO = 'let go of {}{}'
SINCE = '(refused since '
STOPPED = 'E-STOP by the {}'
HOLDS = 'ENTER releases E-STOP (by the {})'
# Zeros that end it all are told so often: one may be lost.
LAST_ZEROS = 3


def axes_of(
    command: Sequence[float], measured: Sequence[float], full: Sequence[float]
) -> tuple[Axis, ...]:
    """Return the axes of a robot on legs: velocities commanded, measured, and at most."""
    names = (('forward', 'm/s'), ('left', 'm/s'), ('turn', 'rad/s'))
    rows = zip(names, command, measured, full, strict=True)
    return tuple(Axis(*name, wanted, now, most) for name, wanted, now, most in rows)


def _let_go(key: str) -> str:
    """Return how a key counts again that was held at a stop, or has been tapped since."""
    event, name = split_event(key)
    # Of a key that is told to be down the release is told, too.
    return LET_GO.format(script_word(name), '' if event == HELD else f' for {SILENCE:g} s')


class Robot(ABC):
    """
    A robot on simulated time: keys and velocities in, motor commands out.

    Sources call `press` and `drive`, and `drivers` says whether they count. A run calls
    `begin_instant` first in each instant, then what `schedule_control` and `schedule_sensing` have
    put on its schedule. `prepare` comes before these, after the last change of `settings`.
    `on_key` and `on_velocity` hear the keys and velocities that the robot obeys.
    """

    has_states = False  # whether keys are more than velocities
    has_odometry = True  # whether something estimates where it is
    estimator = ''  # the source of its odometry; '': as the options say
    other_presets: tuple[str, ...] = ()  # those that are no keymaps
    # The reach of its feet as it stands, base frame (n, 2) [m]; (0, 2) without feet.
    feet = np.empty((0, 2))
    camera: CameraView
    notice: Notice  # messages to the driver; the run steps it

    def __init__(
        self, options: RunOptions, loaded: Description, world: World, simulation: Simulation
    ) -> None:
        self.options, self.description, self.name = options, loaded, options.robot
        self.world, self.simulation = world, simulation
        self.kind = ROBOTS[options.robot].kind
        self.start = world.setup.place
        self.log = logging.getLogger(f'wasd.{self.kind.controller}')
        self.logic: KeysToTwist | None = None  # what makes keys velocities, where these drive
        self.own_keys: frozenset[str] = frozenset()  # those that mean something to this robot
        if self._keys_are_velocities:
            keymap = load_preset(options.preset, options.layout, self.other_presets)
            self.logic = KeysToTwist(keymap)
            self.own_keys = frozenset(self.logic.keymap.keys)
        # A recording has the velocities that keys became: they must not become some again.
        self._is_mute = options.commands is not None
        self.drivers = Drivers(self.stops, self.latches, holds_stops=options.latched)
        self.on_e_stop: Callable[[str], None] = self.e_stop  # a run stops all its robots
        complain = logging.getLogger('wasd.simulator').error
        self.sensors = Sensors(loaded, world, SimulatorParameters(lidar=options.lidar), complain)
        simulation.on_reset += [self.sensors.reset, self.reset, self.drivers.reset]
        simulation.on_resume.append(self._resume)
        self.on_key: list[Callable[[str], None]] = []
        self.on_velocity: list[Callable[[FullVelocity], None]] = []
        # What a guard does to the command in force; '' without a guard.
        self.guard_words: Callable[[], str] = lambda: ''
        self._recorder = Recorder(world, keep=options.samples or options.report is not None)
        self.pushes = Player(options.pushes)
        self._script: TwistPlayer | None = None

    def prepare(self) -> None:
        """Apply the settings, before anything is scheduled."""
        self.ticks = TickStatistics(self.period)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the robot's oddities."""
        return ()

    @property
    @abstractmethod
    def state(self) -> str:
        """The controller's state."""

    @property
    @abstractmethod
    def period(self) -> float:
        """The controller's period [s]."""

    @property
    @abstractmethod
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""

    @property
    @abstractmethod
    def first_keys(self) -> str:
        """The keys to press first."""

    @property
    def refusal(self) -> str:
        """Why it follows no velocity now, with the cure; '' if it does."""
        return self.stop_words or self._refusal

    @property
    def stop_words(self) -> str:
        """How a stop that holds ends; '' while none holds."""
        stopped_by = self.drivers.stopped_by
        return HOLDS.format(stopped_by) if stopped_by else ''

    @property
    def _refusal(self) -> str:
        return ''

    @property
    def drive_limits(self) -> dict[str, float]:
        """A navigator's speed limits, by the names of its parameters `limits.*`."""
        return {}

    @property
    def braking(self) -> tuple[float, float, float]:
        """The sure deceleration ahead, sideways [m/s^2] and in a turn [rad/s^2]."""
        return (1.0, 1.0, 3.0)

    @property
    def braking_delay(self) -> float:
        """How much later than at once it is sure to brake so [s]."""
        return 0.0

    def hold_back(self, limit: Callable[[Sequence[float]], np.ndarray]) -> None:
        """
        Limit each velocity (vx, vy, wz) of the controller by a guard.

        Raises:
            UserError: this controller cannot be limited.
        """
        raise UserError(f'--guard: {self.name} has no controller that a guard can limit')

    @property
    def stop_key(self) -> str:
        """The key that ends every motion by keys."""
        return STOP_KEY

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The keys that stop it and end every motion."""
        return (self.stop_key,)

    @property
    def odometry(self) -> BaseOdometry | None:
        """The present odometry; None before the first estimate."""
        return None

    @property
    def frames(self) -> tuple[str, str]:
        """The frames of odometry and of the base."""
        prefix = self.world.prefix
        return f'{prefix}odom', prefix + self.description.robot.root

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion by keys."""
        return self.logic is not None and self.logic.stops(key)

    def latches(self, key: str) -> bool:
        """Whether the motion of this key continues after its release."""
        return self.logic is not None and self.logic.latches(key)

    def named(self, key: str) -> str:
        """Return what the driver's keyboard calls a key of qwerty."""
        return on_layout(key, self.options.layout)

    def choices(self) -> tuple[Choice, ...]:
        """Return the states with keys; wheels have none."""
        return ()

    def status(self) -> Status:
        """Return the status for the user."""
        status, stop_words = self._status(), self.stop_words
        if not stop_words:
            return status._replace(message=status.message or self.guard_words())
        # Whatever else is said, such as a key to stand, comes after that.
        return status._replace(state='E-STOP', message=stop_words)

    def press(self, key: str, by: str) -> bool:
        """Press a key for a source, in this instant, and tell listeners; False: it is refused."""
        if self.heeds_e_stop(key, by):
            return True
        if not self.drivers.take(by, key=key):
            if key:
                self._say_refused(_let_go(key))
            self.say_if_stopped()
            return False
        if SINCE in self.notice.text:
            self.notice.say(None)  # it counts again, or is released
        self._obey(key, is_pressed=by not in (E_STOP, LOST))
        return True

    def drive(self, velocity: Velocity, by: str, age: float = 0.0) -> bool:
        """Command a source's velocity [m/s], [rad/s], `age` [s] old; False: it is refused."""
        if not self.drivers.take(by, velocity=velocity):
            self.say_if_stopped()
            return False
        self._follow(velocity, age=age)
        return True

    def release(self, by: str) -> None:
        """Release a source and end its motion."""
        self._end(self.drivers.release(by))

    def disarm(self, by: str = '') -> None:
        """Ignore what a source, or every source, holds now, and end its motion."""
        self._end(self.drivers.disarm(by))

    def e_stop(self, by: str) -> None:
        """Stop after `disarm`: the controller releases the motors, and a script ends."""
        self.drivers.stop(by)
        if self._script is not None:
            self._script.end()
        self.let_go(STOPPED.format(by))

    def heeds_e_stop(self, key: str, by: str) -> bool:
        """Return whether a key is that of the e-stop, for any source; if it goes down, stop."""
        event, name = split_event(key)
        if name != E_STOP_KEY:  # which has no other meaning, whatever a keymap says
            return False
        if not event:
            self.on_e_stop(by)
        return True

    def let_go(self, why: str = 'emergency stop') -> None:
        """Stop faster than keys can, at an e-stop, and say why; keys are enough for most."""
        self.say(f'drive again ({why})')

    def end_e_stop(self) -> None:
        """Release a latched stop: a source must press again to drive."""
        if self.drivers.stopped_by:
            self.drivers.release(E_STOP)
            self.say('E-STOP released: drive again')

    def take_topic(self, topic: str, **taken: Any) -> bool:
        """Return whether a message on a topic counts; if not, tell the reason."""
        if self.drivers.take('topic', **taken, what=f'somebody on {topic}'):
            return True
        key = taken.get('key')
        self._say_refused(_let_go(key) if key else REFUSED.format(topic))
        self.say_if_stopped()
        return False

    def follow(self, topic: str, velocity: Velocity, age: float = 0.0) -> bool:
        """Command what came on a topic `age` [s] after it was sent; False: it is refused."""
        counts = self.take_topic(topic, velocity=velocity)
        if counts:
            self.command(velocity, age)
        return counts

    def mute(self, is_mute: bool) -> None:
        """Mute the keyboard while another source drives, or enable it again."""
        if is_mute and not self._is_mute and self.logic is not None:
            self.logic.stop()
            self._step_keys(self.logic, 0.0)
        self._is_mute = is_mute

    def stop(self) -> None:
        """Command standstill, now and in the last message on cmd_vel, until the next key."""
        if self.logic is not None:
            self.logic.stop()
            for _ in range(LAST_ZEROS):
                self._follow(STANDSTILL)

    def say(self, words: str) -> None:
        """Tell the driver."""
        self.notice.say(words)

    def say_if_stopped(self) -> bool:
        """Return whether a stop holds; if so, tell the driver how it ends."""
        if self.stop_words:
            self.say(self.stop_words)
        return bool(self.stop_words)

    def _say_refused(self, cure: str) -> None:
        by = self.drivers.last_stop_by
        self.say(f'{cure} {SINCE}{STOPPED.format(by) if by else "a stop"})')

    def reset(self) -> None:
        """Forget the past: commands, ramps, estimates."""
        if self.logic is not None:
            self.logic.reset()

    def begin_instant(self, now: float) -> None:
        """Apply the pushes that are due at a simulated time [s]."""
        self.drivers.time = now
        if now >= self.pushes.next_time:
            for push in self.pushes.due(now):
                self.world.push(push.force, push.duration, push.point)

    def schedule_control(self, schedule: Schedule) -> None:
        """Step scripts, keys and controller on a schedule, in this order."""
        if self.options.twists is not None:
            drive = functools.partial(self.drive, by='script')
            twists = self._script = TwistPlayer(self.options.twists, drive)
            schedule.every(1.0 / TWIST_RATE, lambda: twists.step(self.world.time))
        if self.logic is not None:
            logic, period = self.logic, 1.0 / self.logic.rate
            schedule.every(period, lambda: self._step_keys(logic, period))
        schedule.at_rate('update_rate', 1.0 / self.period, self._timed_control, self.rest)

    def schedule_sensing(self, schedule: Schedule) -> None:
        """Measure and sample on a schedule, after all controllers."""
        # Also without listeners: noise must not depend on them.
        schedule.every(1.0 / SHOWN_RATE, self._read)
        # As often as possible without making physics stop more often.
        stride = schedule.stride * self.world.time_step
        schedule.every(stride, self.sensors.step, self.sensors.rest)
        schedule.every(SAMPLE_PERIOD, lambda: self._recorder.sample(self.sample()))

    def report(self, wall_time: float, **parts: Any) -> dict[str, Any]:
        """Return the report for the `wall_time` [s] so far, with `parts` of others."""
        options = self.options
        asked: dict[str, Any] = {
            'robot': options.robot,
            'description': self.description.record(),
            'world': options.world,
            'seed': options.seed,
            'estimator': self.estimator or options.estimator,
        }
        if options.untold.randomise:
            asked['drawn'] = dataclasses.asdict(self.world.setup.drawn)
        asked |= parts
        ticks = self.ticks.summary()
        return build_report(self._recorder, asked, self.world.time, wall_time, ticks)

    def close(self) -> None:
        """Leave the robot stopped, its motors braking."""
        self.stop()
        self.world.brake()
        self.sensors.close()

    @abstractmethod
    def command(self, velocity: Velocity, age: float = 0.0) -> None:
        """Give the controller a velocity [m/s], [m/s], [rad/s] of any source, `age` [s] old."""

    @abstractmethod
    def control(self) -> None:
        """Step the controller on the present state, and give its command to the world."""

    @abstractmethod
    def sample(self) -> Sample:
        """Return the present sample of the report."""

    @abstractmethod
    def _status(self) -> Status:
        """Return the status for the user while no e-stop holds."""

    @property
    def _keys_are_velocities(self) -> bool:
        return True

    def _press(self, key: str, is_pressed: bool) -> None:
        """Handle a key; one that nobody pressed, as for a lost page, gets no answer."""
        if self.logic is not None:
            self.logic.press(key)

    def _obey(self, key: str, is_pressed: bool) -> None:
        self._press(key, is_pressed)
        for tell in self.on_key:
            tell(key)

    def _resume(self) -> None:
        """End a velocity of a topic after a pause: nobody knows who still wants it."""
        if self.drivers.state.driver == 'topic' and self.drivers.held('topic').velocity:
            self.drive(STANDSTILL, 'topic')

    def _end(self, held: Held) -> None:
        if held.velocity:
            self._follow(STANDSTILL)
        if held.keys:
            self._obey(self.stop_key, is_pressed=False)

    def _follow(self, velocity: Velocity, up: float = 0.0, age: float = 0.0) -> None:
        """Command a velocity, and tell listeners."""
        if age:
            self.command(velocity, age)
        else:  # a controller of another kind may not ask for it
            self.command(velocity)
        told = (velocity[0], velocity[1], up, velocity[2])
        for tell in self.on_velocity:
            tell(told)

    def _step_keys(self, logic: KeysToTwist, dt: float) -> None:
        velocity = None if self._is_mute else logic.step(dt)
        if velocity is not None:
            self._follow((velocity.vx, velocity.vy, velocity.wz), velocity.vz)

    def _read(self) -> None:
        self.world.read()

    def rest(self) -> float:
        """Return for how long from now [s] the controller has nothing to do."""
        return 0.0

    def _timed_control(self) -> None:
        started = time.perf_counter()
        self.control()
        self.ticks.add(time.perf_counter() - started)
