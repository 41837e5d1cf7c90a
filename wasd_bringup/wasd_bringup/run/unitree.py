# SPDX-License-Identifier: Apache-2.0
"""`--interface unitree`: programs of Unitree's SDK drive the robot, as any other source does."""

from collections.abc import Callable
from functools import partial

from unitree_bridge.bridge import Bridge, INTO, OUT
from unitree_bridge.connection import open_wire
from unitree_bridge.legs_robot import Commands, LegsRobot
from unitree_bridge.robot import SOURCE
from unitree_bridge.topics import LIDAR_OUT, LIDAR_SWITCH
from unitree_bridge.utlidar import serve_lidar
from unitree_bridge.wire import Wire
from wasd_core.errors import UserError
from wasd_core.robot_io import JointCommand

from wasd_bringup.run.go2 import Go2
from wasd_bringup.run.guarding import RobotGuard
from wasd_bringup.run.sensing import guard_parameters_of, lidar_of

# What a program presses that commands the motors themselves: no key of a keyboard.
MOTORS = 'LowCmd'


def idle_guard(robot: Go2) -> RobotGuard | None:
    """Return a guard that does nothing until it is switched on; None where there is no lidar."""
    try:
        lidar_of(robot, '')
    except UserError:
        return None
    guard = RobotGuard(robot)
    guard.unit.tune(guard_parameters_of(robot, enabled=False))
    return guard


class UnitreeDriver:
    """
    Serves Unitree's interface over a Go2 of a run.

    Programs press its keys, drive it, or have its motors, while `Drivers` says that they count.
    Another source that drives ends what they asked our controller for; they keep the motors until
    an E-STOP. It is stepped by the robot, before our controller.
    """

    def __init__(
        self, robot: Go2, wire: Wire | None = None, guard: RobotGuard | None = None
    ) -> None:
        """
        Join the domain of the robot's options, unless there is a wire already.

        Programs switch `guard` on and off; one asked for by --guard stays on.

        Raises:
            UserError: it cannot be joined.
        """
        self.robot, options = robot, robot.options
        self._guard = guard
        self._where = f'domain {options.domain} on {options.network}'
        self._wire = wire or open_wire(
            options.domain, options.network, (*OUT, *LIDAR_OUT), (*INTO, LIDAR_SWITCH)
        )
        commands = Commands(
            press=lambda key: robot.press(robot.named(key), SOURCE),
            drive=partial(robot.drive, by=SOURCE),
            take_motors=partial(
                robot.drivers.take, SOURCE, key=MOTORS, what='an SDK program (LowCmd)'
            ),
            guard=self._switch_guard,
        )
        self._legs = LegsRobot(robot.legs, robot.world, commands)
        self.bridge = Bridge(
            self._legs,
            self._wire,
            self._say,
            is_synced=options.sync,
            lidar=serve_lidar(self._legs, robot.sensors, robot.world),
        )
        self.may_advance = self.bridge.may_advance
        # Hears once that a program does what neither a key nor a velocity says.
        self.on_deed: Callable[[], object] = lambda: None
        robot.outside = self
        robot.drivers.on_take.append(self._give_way)
        robot.simulation.on_reset.append(self.bridge.reset)
        robot.simulation.on_resume.append(self.bridge.motion.halt)

    @property
    def first_line(self) -> str:
        """The first line for the user."""
        waits = '; time begins with a program' if self.robot.options.sync else ''
        return f'Unitree SDK: {self._where}{waits}'

    def step(self, dt: float) -> None:
        """Take and tell what is due, `dt` [s] after the step before."""
        self.bridge.step(dt)
        if self.bridge.low.is_released:
            self._tell_deed()

    def motors(self) -> JointCommand | None:
        """Return the motors' command of a program, None where our controller has them."""
        command = self.bridge.in_force
        return None if command is None else self._legs.motors(command)

    def look(self) -> None:
        """Answer also while simulated time stands still."""
        if self.robot.simulation.paused:
            self.bridge.serve()

    def repeat(self) -> None:
        """Nothing: the robot steps it."""

    def disarm(self) -> None:
        """Ignore what programs command now."""
        self.bridge.disarm()

    def close(self) -> None:
        """Be gone for all programs."""
        self.robot.outside = None
        self.bridge.close()
        self._legs.close()

    def _switch_guard(self, is_on: bool) -> bool:
        if self._guard is None or self.robot.options.guard:
            return self._guard is not None
        self._guard.unit.tune(guard_parameters_of(self.robot, enabled=is_on))
        if is_on:
            self._tell_deed()
        return is_on

    def _tell_deed(self) -> None:
        tell, self.on_deed = self.on_deed, lambda: None
        tell()

    def _give_way(self, source: str, what: str) -> None:
        if source != SOURCE:
            self.bridge.give_way()

    def _say(self, text: str) -> None:
        self.robot.say(text)
        self.robot.log.info('unitree: %s', text)
