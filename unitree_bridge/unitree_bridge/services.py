# SPDX-License-Identifier: Apache-2.0
"""The services of the Go2 that its SDK has clients of; ids and parameters are the SDK's."""

from collections.abc import Callable
import contextlib
from functools import partial
from typing import Any

from quadruped_sim.keys import StateName
from wasd_core.errors import UserError

from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.low_level import LowLevel
from unitree_bridge.motion import Motion
from unitree_bridge.rpc import (
    Answer,
    BAD_PARAMETER,
    flag,
    Handler,
    INTERNAL,
    NOT_IMPLEMENTED,
    number,
    Parameters,
    Refused,
    Service,
    word,
)

Say = Callable[[str], None]

# What our controller is called where modes have names, and the names that stand for it.
MODE = 'mcf'
MODES = (MODE, 'normal', 'ai', 'advanced')
# Tricks that are known and not simulated.
TRICKS = {
    1009: 'Sit',
    1010: 'RiseSit',
    1016: 'Hello',
    1017: 'Stretch',
    1020: 'Content',
    1022: 'Dance1',
    1023: 'Dance2',
    1029: 'Scrape',
    1030: 'FrontFlip',
    1032: 'FrontPounce',
    1036: 'Heart',
    2041: 'LeftFlip',
    2043: 'BackFlip',
    2044: 'HandStand',
    2050: 'WalkUpright',
    2051: 'CrossStep',
}


class Sport(Service):
    """Stands, walks, leans: what the leg controller does. What it does not is answered 3203."""

    name, version = 'sport', '1.0.0.1'

    def __init__(self, motion: Motion, low: LowLevel, avoid: 'ObstaclesAvoid', say: Say) -> None:
        self._motion, self._low, self._say = motion, low, say
        self.follows_remote = True
        self._recovers = True
        self._handlers = {
            1001: lambda _: self.damp(),
            1002: self._goer(StateName.FREE_STAND),
            1003: lambda _: motion.stop(),
            1004: self._goer(StateName.FIXED_STAND),
            1005: self._stand_down,
            1006: self._goer(StateName.FIXED_STAND),
            1007: self._euler,
            1008: self._move,
            1015: self._speed_level,
            1027: self._switch_joystick,
            1028: self._pose,
            1031: self._goer(StateName.JUMP),
            1061: self._stepper('walk'),
            1062: self._stepper('trot'),
            1063: self._stepper('trot'),
            2045: self._stepper('trot'),
            2046: self._switched('bound'),
            2047: self._switched('pronk'),
            2048: lambda said: avoid.switch(flag(said, 'data')),
            2049: self._switched('walk'),
            2054: self._set_recovery,
            2055: lambda _: Answer({'data': self._recovers}),
            2058: lambda _: avoid.switch(not avoid.is_on),
        }

    def handler(self, api_id: int) -> Handler | None:
        """Return who answers an id; say of a trick that it is not simulated."""
        if api_id in TRICKS:
            self._say(f'sport: {TRICKS[api_id]} ({api_id}) is not simulated (answered 3203)')
        return super().handler(api_id)

    def _goer(self, goal: StateName) -> Handler:
        def go(_: Parameters) -> None:
            if not self._is_released(goal.value):
                self._motion.go(goal)

        return go

    def damp(self) -> None:
        """Damp also where a program commands the motors: it has to let go of them."""
        self._low.damp()
        self._motion.go(StateName.PASSIVE)

    def _stand_down(self, said: Parameters) -> None:
        if not self._motion.lies:
            self._goer(StateName.LIE_DOWN)(said)

    def _stepper(self, gait: str) -> Handler:
        return lambda _: self._motion.choose_gait(gait)

    def _switched(self, gait: str) -> Handler:
        return lambda said: self._motion.choose_gait(gait if flag(said, 'data') else 'trot')

    def _euler(self, said: Parameters) -> None:
        angles = number(said, 'x'), number(said, 'y'), number(said, 'z')
        if not self._is_released('Euler'):
            self._motion.lean(*angles)

    def _move(self, said: Parameters) -> None:
        velocity = number(said, 'x'), number(said, 'y'), number(said, 'z')
        self.move(velocity)

    def move(self, velocity: tuple[float, float, float]) -> None:
        """Move so [m/s], [m/s], [rad/s], where our controller has the motors and stands."""
        if self._is_released('Move') or self._motion.move(velocity):
            return
        if self._motion.lies:
            self._say('sport: Move has no effect on a lying robot (StandUp first)')
        else:
            self._say('sport: Move was stopped (it counts after StopMove, or 1.2 s without it)')

    def _speed_level(self, said: Parameters) -> None:
        level = number(said, 'data')
        if level not in (-1, 0, 1):
            raise Refused(BAD_PARAMETER)
        self._motion.is_slow = level == -1

    def _switch_joystick(self, said: Parameters) -> None:
        self.follows_remote = flag(said, 'data')

    def _pose(self, said: Parameters) -> None:
        is_on = flag(said, 'data')
        if not self._is_released('Pose'):
            self._motion.go(StateName.FREE_STAND if is_on else StateName.FIXED_STAND)

    def _set_recovery(self, said: Parameters) -> None:
        self._recovers = flag(said, 'data')

    def _is_released(self, what: str) -> bool:
        if self._low.is_released:
            self._say(f'sport: {what}: motors are released (motion_switcher: SelectMode first)')
        return self._low.is_released


class MotionSwitcher(Service):
    """Says who has the motors, our controller by its name or nobody, and changes that."""

    name, version = 'motion_switcher', '1.0.0.1'

    def __init__(self, low: LowLevel, release: Callable[[], None]) -> None:
        self._low = low
        self._is_silent = False
        self._handlers = {
            1001: self._check,
            1002: self._select,
            1003: lambda _: release(),
            1004: self._set_silent,
            1005: lambda _: Answer({'silent': self._is_silent}),
        }

    def _check(self, _: Parameters) -> Answer:
        return Answer({'form': '0', 'name': '' if self._low.is_released else MODE})

    def _select(self, said: Parameters) -> None:
        if word(said, 'name') not in MODES:
            raise Refused(NOT_IMPLEMENTED)
        self._low.select()

    def _set_silent(self, said: Parameters) -> None:
        self._is_silent = flag(said, 'silent')


class ObstaclesAvoid(Service):
    """Switches the guard that stops before obstacles, and moves by it."""

    name, version = 'obstacles_avoid', '1.0.0.2'

    def __init__(
        self, robot: LegsRobot, move: Callable[[tuple[float, float, float]], None]
    ) -> None:
        self._robot = robot
        self.move = move
        self.is_on = robot.guard(False)  # one asked for by --guard is on, and stays so
        self._from_api = False
        self._handlers = {
            1001: lambda said: self.switch(flag(said, 'enable')),
            1002: lambda _: Answer({'enable': self.is_on}),
            1003: self._move,
            1004: self._take_over,
        }

    def switch(self, is_on: bool) -> None:
        """
        Switch the guard.

        Raises:
            Refused: the robot has none, or one that stays on.
        """
        self.is_on = self._robot.guard(is_on)
        if self.is_on != is_on:
            raise Refused(NOT_IMPLEMENTED)

    def _move(self, said: Parameters) -> None:
        velocity = number(said, 'x'), number(said, 'y'), number(said, 'yaw')
        if number(said, 'mode') != 0:
            raise Refused(NOT_IMPLEMENTED)  # to a place
        if self._from_api:
            self.move(velocity)

    def _take_over(self, said: Parameters) -> None:
        self._from_api = flag(said, 'is_remote_commands_from_api')


class RobotState(Service):
    """Lists the services, and switches the one that can be."""

    name, version = 'robot_state', '1.0.0.1'
    _SWITCHED = ('sport_mode', MODE)

    def __init__(self, low: LowLevel, release: Callable[[], None], names: list[str]) -> None:
        self._low, self._release, self._names = low, release, names
        self._handlers = {
            1001: self._switch,
            1002: lambda _: None,
            1003: self._list,
        }

    def _list(self, _: Parameters) -> Answer:
        on = int(not self._low.is_released)
        services = [{'name': self._SWITCHED[0], 'status': on, 'protect': 0}]
        services += [{'name': name, 'status': 1, 'protect': 1} for name in self._names]
        return Answer(services)

    def _switch(self, said: Parameters) -> Answer:
        name, is_on = word(said, 'name'), flag(said, 'switch')
        if name not in self._SWITCHED:
            return Answer({'name': name, 'status': 5})  # it is protected
        if is_on:
            self._low.select()
        else:
            self._release()
        return Answer({'name': name, 'status': int(is_on)})


class VideoHub(Service):
    """Takes a picture of what is ahead."""

    name, version = 'videohub', '1.0.0.1'

    def __init__(self, robot: LegsRobot, say: Say) -> None:
        self._robot, self._say = robot, say
        self._handlers = {1001: self._picture}
        self._is_ready = False

    def prepare(self) -> None:
        """Take a first picture, which takes as long as tens of later ones; once."""
        if not self._is_ready:
            self._is_ready = True
            with contextlib.suppress(UserError):  # who asks for one is told
                self._robot.picture()

    def _picture(self, _: Parameters) -> Answer:
        try:
            return Answer(binary=self._robot.picture())
        except UserError as error:
            self._say(f'videohub: no picture: {error}')
            raise Refused(INTERNAL) from None


class Vui(Service):
    """Remembers how loud and how bright it was told to be."""

    name, version = 'vui', '1.0.0.1'
    _SETTINGS = ('enable', 'volume', 'brightness')

    def __init__(self) -> None:
        self._values: dict[str, Any] = dict.fromkeys(self._SETTINGS, 0)
        self._handlers = {}
        for i, setting in enumerate(self._SETTINGS):
            self._handlers[1001 + 2 * i] = partial(self._set, setting)
            self._handlers[1002 + 2 * i] = partial(self._get, setting)

    def _set(self, setting: str, said: Parameters) -> None:
        self._values[setting] = round(number(said, setting))

    def _get(self, setting: str, _: Parameters) -> Answer:
        return Answer({setting: self._values[setting]})
