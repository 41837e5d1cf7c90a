# SPDX-License-Identifier: Apache-2.0
"""Connects a run and the page: makes snapshots of the run, carries out the page's orders."""

import dataclasses
from functools import partial
import math
from typing import TYPE_CHECKING

from mujoco_sim.viewer.views import NativeView, start_view
import numpy as np
from wasd_cockpit.cockpit import Cockpit, usual_path
from wasd_cockpit.link import (
    Choice,
    Columns,
    Grip,
    History,
    Link,
    moved,
    Order,
    PlanarPose,
    RATE,
    Snapshot,
    SPAN,
    Stick,
)
from wasd_core.errors import UserError
from wasd_core.rotations import matrix_from_quaternion
from wasd_core.timing import HELD, RELEASE, split_event, TWIST_RATE

from wasd_bringup.page.restart import choices_of, page_port, restart_words
from wasd_bringup.page.robot_view import RobotView
from wasd_bringup.robots import load_class
from wasd_bringup.run.inputs import E_STOP_KEY, END_E_STOP_KEY, RESET_KEY
from wasd_bringup.run.report import SAMPLE_PERIOD
from wasd_bringup.run.robot import Robot, Velocity
from wasd_bringup.run.run import Run

if TYPE_CHECKING:
    from wasd_bringup.run.navigation import NavigationDriver

# Snapshots are made, and a held stick is sent, once in so many states of the scene.
SNAPSHOT_EVERY = 2.5
# A key that was pressed is lit for so long [s of wall time].
LIT_TIME = 0.25
# Places of the trail: one every so many samples, and how many.
TRAIL_EVERY, TRAIL_LENGTH = 10, 600
# The states that can follow are looked at in one of so many snapshots: ten times a second, or
# three where the page's pace is that of a hurried simulation.
CHOICES_EVERY = 3
# Least and largest speed of time; 0 is as fast as possible.
SLOWEST, FASTEST = 0.01, 100.0


class RobotHistory:
    """One robot of the run with its past."""

    def __init__(self, robot: Robot, navigation: 'NavigationDriver | None') -> None:
        self.robot = robot
        self.navigation = navigation
        self.view: RobotView = load_class(robot.kind.view)(robot)
        self.columns = Columns(self.view.feet, robot.world.motor_names)
        self.history = History(round(SPAN * RATE), self.columns.width)
        self.trail = History(TRAIL_LENGTH, 2)
        model = robot.world.model
        limits = model.actuator_forcerange[robot.world.parts.motors, 1]
        self.mass = float(model.body_subtreemass[robot.world.root])
        self._limits = np.where(limits > 0.0, limits, 1.0).copy()
        self._samples = 0
        self.keys = self.view.keys()
        self._choices: tuple[Choice, ...] = ()
        self._chosen_in = ''
        self._chosen_for = 0

    def choices(self) -> tuple[Choice, ...]:
        """
        Return the states as buttons, looked at again with each other state, else a few times.

        Why each cannot be pressed costs more than all else that the page is told.
        """
        state = self.robot.state
        if state != self._chosen_in or self._chosen_for == 0:
            self._choices, self._chosen_in = self.view.choices(), state
            self._chosen_for = CHOICES_EVERY
        self._chosen_for -= 1
        return self._choices

    def sample(self, pace: float) -> None:
        """Remember this instant."""
        world, motion = self.robot.world, self.view.motion()
        base = world.base()
        efforts = world.joints().effort[world.parts.motor_joint] / self._limits
        tick = 1e3 * self.robot.ticks.last
        head = (world.time, *motion.command, *motion.odometry, *base.planar_velocity, tick, pace)
        self.history.add(np.array([*head, *motion.forces, *motion.stances, *efforts]))
        if self._samples % TRAIL_EVERY == 0:
            self.trail.add(base.position[:2])
        self._samples += 1

    def forget(self) -> None:
        """Forget the past."""
        self.history.clear()
        self.trail.clear()
        self._samples = 0


class CockpitBridge:
    """
    The cockpit's part of a run, in its thread.

    `step` comes at each look at the page; it does what the page has ordered since the last one.
    All that it changes goes through the run's keys and velocities, which recordings have.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._start, self._port = choices_of(run.options), ''
        self._link = Link()
        self.content = Cockpit(self._link, usual_path())
        self.close = self.content.close
        self.content.page.sight.world = run.world
        navigations = run.navigations or len(run.robots) * [None]
        self._watched = [
            RobotHistory(robot, navigation)
            for robot, navigation in zip(run.robots, navigations, strict=True)
        ]
        for watched in self._watched:
            watched.view.is_looked_at = partial(self._is_looked_at, watched)
        self._next = 0.0
        self._pressed: dict[str, float] = {}
        self._now = 0.0
        # The robot that the stick moves, and by which velocity; None where it presses keys.
        self._driven: int | None = None
        self._velocity: Velocity | None = None
        self._is_ignored = False  # the stick, until it is released
        self._pushed: int | None = None

    def attach(self, where: str) -> None:
        """Be told of what happens from now on; the page is at an address."""
        run = self._run
        self._port = where.rpartition(':')[2].strip('/')
        run.on_key.append(self.note_key)
        run.on_look.append(self.step)
        run.on_disarm.append(self._disarm)
        run.on_loss.append(self._disarm)
        run.on_end.append(self.close)
        run.simulation.on_reset.append(self.forget)
        run.simulation.schedule.every(SAMPLE_PERIOD, self.sample)
        run.simulation.schedule.every(1.0 / TWIST_RATE, self._repeat)

    def sample(self) -> None:
        """Remember this instant of all robots."""
        pace = self._run.simulation.pacer.real_time_factor
        for watched in self._watched:
            watched.sample(pace)

    def note_key(self, key: str) -> None:
        """Note that a source pressed, holds or released a key."""
        event, base = split_event(key)
        if event == RELEASE:
            self._pressed.pop(base, None)
        else:
            lasting = 4.0 * LIT_TIME if event == HELD else LIT_TIME
            self._pressed[base] = self._now + lasting

    def forget(self) -> None:
        """Forget the past."""
        for watched in self._watched:
            watched.forget()

    def step(self, now: float, period: float) -> None:
        """
        Do what was ordered, and tell the page of a wall time [s].

        `period` is the time between two states of the scene [s].
        """
        self._now = now
        for order in self._link.take_orders():
            self._obey(order)
        self._release()
        if now < self._next:
            return
        self._next = now + SNAPSHOT_EVERY * period
        stick = self._link.stick
        if stick is not None and not self._is_ignored:
            self._driven = self._run.active
            self._move(self._driven, stick)
        self._push()
        self._link.snapshot = self._snapshot(now)

    def _obey(self, order: Order) -> None:
        run = self._run
        simulation = run.simulation
        if order.what == 'key':
            run.press(order.name, 'page')
        elif order.what == 'e-stop':
            run.press(E_STOP_KEY, 'page')
        elif order.what == 'end e-stop' and self._active.robot.drivers.stopped_by:
            run.press(END_E_STOP_KEY, 'page')
        elif order.what == 'pause':
            simulation.paused = bool(order.value)
        elif order.what == 'step' and simulation.paused:
            simulation.step(simulation.schedule.stride)
        elif order.what == 'reset' and RESET_KEY in self._active.robot.own_keys:
            simulation.reset()  # by no key: a keymap took it
        elif order.what == 'reset':
            run.press(RESET_KEY, 'page')
        elif order.what == 'robot':
            run.switch_to([robot.name for robot in run.robots].index(order.name))
        elif order.what == 'speed' and 0.0 <= order.value < math.inf:
            speed = min(max(round(order.value, 2), SLOWEST), FASTEST)  # ImGui's number has 24 bits
            simulation.pacer.speed = speed if order.value > 0.0 else 0.0
            simulation.pacer.restart()
        elif order.what == 'start' and not self._active.robot.say_if_stopped():
            robot, world = order.name.split(maxsplit=1)
            if self._start.offers(robot, world):
                run.next_words = restart_words(run.options.words, robot, world, self._port)
        elif order.what in ('goal', 'cancel goal', 'explore', 'save map'):
            self._navigate(order)
        elif order.what == 'choose':
            setting, _, option = order.name.partition('=')
            for key in self._active.view.keys_to_choose(setting, option):
                run.press(key, 'page')

    def _navigate(self, order: Order) -> None:
        """Do what is asked of the navigator, if there is one."""
        navigation = self._active.navigation
        if navigation is None:
            return
        if order.what == 'goal':
            navigation.go([float(word) for word in order.name.split()], from_page=True)
        elif order.what == 'cancel goal':
            navigation.disarm()
        else:
            try:
                if order.what == 'explore':
                    navigation.explore(from_page=True)
                else:
                    navigation.save()
            except UserError as error:
                self._active.robot.say(str(error))

    @property
    def _active(self) -> RobotHistory:
        return self._watched[self._run.active]

    @property
    def _grip(self) -> Grip:
        """What a hand that begins to push now takes hold of."""
        return self._run.active, self._run.world.physics.resets

    def _is_looked_at(self, watched: RobotHistory) -> bool:
        """Whether the page looks at the elevation of this robot."""
        return self._link.is_looked_at and watched is self._active

    def _release(self) -> None:
        """End, without waiting for a snapshot, what a hand no longer does to the robot in turn."""
        active, link = self._run.active, self._link
        self._is_ignored &= link.has_stick  # a page that is only late has not let go
        if self._driven not in (None, active):
            self._disarm()
        elif link.stick is None:
            self.let_go()
        if self._pushed is not None and (link.push is None or self._pushed != active):
            self._push()

    def _repeat(self) -> None:
        """Drive at the stick's last velocity again: it counts for a simulated time only."""
        drives = self._link.stick is not None and self._driven == self._run.active
        if self._velocity is not None and drives:
            self._active.robot.drive(self._velocity, 'page')

    def _push(self) -> None:
        """Push the robot in turn as the hand that took hold of it does, and no other one."""
        push, force = self._link.push, (0.0, 0.0, 0.0)
        self._pushed = None
        if push is not None and push.grip == self._grip:
            force, self._pushed = push.force, self._run.active
        for watched in self._watched:
            is_active = watched is self._active
            watched.robot.world.keep_pushing(force if is_active else (0.0, 0.0, 0.0))

    def _disarm(self) -> None:
        """Stop what the stick moves, and ignore it until it is released."""
        self._is_ignored = self._link.has_stick
        self.let_go()

    def let_go(self) -> None:
        """Stop what the stick moves."""
        if self._driven is not None:
            driven, self._driven = self._driven, None
            self._move(driven, Stick())

    def _move(self, robot: int, stick: Stick) -> None:
        watched = self._watched[robot]
        keys = watched.view.stick_keys(stick)
        self._velocity = watched.view.stick_use().velocity(stick) if keys is None else None
        if self._velocity is not None:
            watched.robot.drive(self._velocity, 'page')
        elif keys:
            self._run.press_for(robot, keys, 'page')

    def _snapshot(self, now: float) -> Snapshot:
        run, watched = self._run, self._active
        simulation, world = run.simulation, watched.robot.world
        status, view = watched.robot.status(), watched.view
        base = world.base()
        x, y, _ = base.position.tolist()
        self._pressed = {key: until for key, until in self._pressed.items() if until > now}
        pose = PlanarPose(x, y, float(base.rpy[2]))
        navigation = None if watched.navigation is None else watched.navigation.view()
        marks = view.marks(base.position, matrix_from_quaternion(base.orientation))
        if navigation is not None and navigation.goal is not None:
            marks = dataclasses.replace(marks, path=moved(navigation.path, navigation.pose, pose))
        return Snapshot(
            time=world.time,
            is_paused=simulation.paused,
            speed=simulation.pacer.speed,
            pace=simulation.pacer.real_time_factor,
            robots=tuple(robot.name for robot in run.robots),
            robot=run.active,
            grip=self._grip,
            state=status.state,
            # Legs have but the command, which the marks tell, too.
            facts=() if watched.robot.has_states else status.facts,
            message=status.message,
            stopped_by=watched.robot.drivers.stopped_by,
            choices=watched.choices(),
            settings=view.settings(),
            stick=view.stick_use(),
            keys=watched.keys,
            lit=frozenset(self._pressed),
            columns=watched.columns,
            history=watched.history.last(),
            trail=watched.trail.last(),
            pose=pose,
            body=world.root,
            mass=watched.mass,
            marks=marks,
            qpos=world.data.qpos.copy(),
            start=self._start,
            mocap=np.hstack((world.data.mocap_pos, world.data.mocap_quat)),
            navigation=navigation,
            elevation=view.elevation() if self._link.is_looked_at else None,
            no_elevation=view.no_elevation,
        )


def open_view(run: Run, kind: str) -> str:
    """
    Show a run by a viewer, `web` with the cockpit or `native`; return where it is.

    Raises:
        SimulationError: the port is taken, or there is no display.
    """
    bridge = CockpitBridge(run)
    port = page_port(run.options.port)
    view, where = start_view(kind, run.world, run.robot.camera, bridge.content, port)
    run.view, run.where = view, where
    if not isinstance(view, NativeView):
        view.input.can_stop = True
        bridge.attach(where)
    return where
