# SPDX-License-Identifier: Apache-2.0
"""`wasd calibrate`: estimates the wheels from squares driven both ways (UMBmark)."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import shlex
import sys
import tempfile
from typing import Any, NamedTuple

from diff_drive_sim.calibration import least_squares, SquareRun, Umbmark, umbmark, Wheels
from diff_drive_sim.controller_file import NODE_NAME, read_controller_file
from diff_drive_sim.odometry import DiffDriveGeometry, find_wheels
import numpy as np
from robot_description.description import load_robot
from robot_description.morphology.wheels import ANY_WHEELS
from wasd_core.errors import UserError
from wasd_core.output_file import check_apart, OutputFile
from wasd_core.signals import StopSignals
from wasd_core.streams import offer
from wasd_core.timing import TWIST_RATE
import yaml

from wasd_bringup.cli.options import read_folders
from wasd_bringup.robots import MBOT
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

# Commands last whole periods of the stream they are sent in [s].
TICK = 1.0 / TWIST_RATE
# Each run has its own speeds [m/s], [rad/s], so that it slips in its own way ...
SPEEDS = (0.15, 0.30)
TURN_RATES = (0.5, 1.0)
# ... and no more than this share of what the controller allows: legs end by time.
SHARE = 0.9
# Before the next leg the robot has stood still for so long [s]; it is given up after the second.
REST, PATIENCE = 0.3, 60.0

Velocity = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class SquareTest:
    """The test: the robot, the size of the squares, and their number each way."""

    description: str = MBOT.description
    package_path: tuple[Path, ...] = ()
    side: float = 1.0  # [m]
    runs: int = 3
    seed: int = 0

    @property
    def count(self) -> int:
        """How many squares there are."""
        return 2 * self.runs


class DrivenSquares(NamedTuple):
    """The runs, and odometry's geometry."""

    runs: list[SquareRun]
    geometry: DiffDriveGeometry


def drive_squares(
    test: SquareTest,
    parameters: dict[str, Any],
    signals: Any,
    note: Callable[[int], None] = lambda number: None,
) -> DrivenSquares:
    """
    Drive the squares at full speed with these parameters of the controller.

    `note` is told the number of the square that is next.

    Raises:
        UserError: the robot cannot be driven, or does not come to rest.
        KeyboardInterrupt: `signals` has been requested to stop.
    """
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'controller.yaml'
        file.write_text(yaml.safe_dump(parameters), encoding='utf-8')
        options = RunOptions(
            robot=MBOT.name,
            description=test.description,
            package_path=test.package_path,
            preset=MBOT.preset,
            mode='sim',
            controller=file if parameters else None,
            speed=0.0,
        )
        # The test finds errors of the description: no run warns of them.
        for number in range(test.count):
            note(number)
            run = Run(options)
            try:
                square = _Square(run, test, number, signals)
                run.run(square)
                if signals.requested:
                    raise KeyboardInterrupt
                runs.append(square.run())
            finally:
                run.close()
    return DrivenSquares(runs, square.geometry)


class _Square:
    """Drives one square in a run and writes down angles and truth at every control step."""

    def __init__(self, run: Run, test: SquareTest, number: int, signals: Any) -> None:
        self._world, self._signals = run.world, signals
        robot: Any = run.robot  # with wheels
        self._robot = robot
        self.geometry = robot.geometry
        self._is_done = False
        self._turn = 1 if number % 2 == 0 else -1
        self._rows: list[tuple[float, ...]] = []
        random = np.random.default_rng([test.seed, number // 2])
        limits, wheels = robot.drive_limits, self.geometry
        rim = wheels.speed_limit * min(wheels.left_radius, wheels.right_radius)
        most = min(limits['forward'], rim)
        quickest = min(limits['yaw'], 2.0 * rim / wheels.wheel_separation)
        speed = min(random.uniform(*SPEEDS), SHARE * most)
        rate = min(random.uniform(*TURN_RATES), SHARE * quickest)
        self._velocities = self._plan(test.side, speed, rate)
        schedule = run.simulation.schedule
        schedule.at_rate('update_rate', 1.0 / robot.period, self._record)
        schedule.every(TICK, self._drive)

    @property
    def requested(self) -> bool:
        """Whether to stop: from outside, or because it is done."""
        return self._signals.requested or self._is_done

    def run(self) -> SquareRun:
        """Return what was recorded."""
        rows = np.array(self._rows)
        x, y, yaw = self._robot.sample().odometry
        end = np.array([x, y]) + self._to_axle(yaw) - self._to_axle(0.0)
        return SquareRun(self._turn, rows[:, 0], rows[:, 1], rows[:, 2:], (end[0], end[1]))

    def _plan(self, side: float, speed: float, rate: float) -> Iterator[Velocity]:
        """Yield a velocity for every tick; legs are as fast as fits whole ticks."""
        corner = 0.5 * math.pi
        straight = max(1, round(side / speed / TICK))
        turning = max(1, round(corner / rate / TICK))
        for _ in range(4):
            yield from [(side / (straight * TICK), 0.0, 0.0)] * straight
            yield from self._stand()
            yield from [(0.0, 0.0, self._turn * corner / (turning * TICK))] * turning
            yield from self._stand()

    def _stand(self) -> Iterator[Velocity]:
        """Yield zero until the robot has stood still for a while."""
        rested = 0
        for _ in range(round(PATIENCE / TICK)):
            yield (0.0, 0.0, 0.0)
            rested = rested + 1 if self._robot.state == 'stopped' else 0
            if rested * TICK >= REST:
                return
        raise UserError(f'the robot does not come to rest within {PATIENCE:.0f} s')

    def _drive(self) -> None:
        velocity = next(self._velocities, None)
        if velocity is None:
            self._is_done = True
        else:
            self._robot.command(velocity)

    def _record(self) -> None:
        world, geometry = self._world, self.geometry
        angles = dict(zip(world.joint_names, world.joints().position.tolist(), strict=True))
        base = world.base()
        yaw = float(base.rpy[2])
        x, y = (base.position[:2] + self._to_axle(yaw)).tolist()
        left, right = geometry.flip((angles[geometry.left_joint], angles[geometry.right_joint]))
        self._rows.append((left, right, x, y, yaw))

    def _to_axle(self, yaw: float) -> np.ndarray:
        """Return where the axle's middle is from the base, in the world's axes [m], (2,)."""
        x, y = self.geometry.axle_x, self.geometry.axle_y
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([cos * x - sin * y, sin * x + cos * y])


# A return error that needs no calibration [m].
GOOD = 0.002
RADIUS = 'wheel_radius'
SEPARATION = 'wheel_separation'
LEFT, RIGHT = 'left_wheel_radius_multiplier', 'right_wheel_radius_multiplier'
SEPARATION_MULTIPLIER = 'wheel_separation_multiplier'


def calibrate_command(arguments: argparse.Namespace) -> int:
    """
    Drive squares, print what they say, and drive them again with it; return the exit status.

    It is 1 when the corrected robot returns worse than before, and worse than GOOD.

    Raises:
        UserError: what is wrong with the options, in one line.
    """
    test = _read_test(arguments)
    believed = _read_belief(arguments, test)
    output = None if arguments.output is None else OutputFile(arguments.output, '--output')
    if output is not None:
        inputs = {'--controller': arguments.controller, 'DESCRIPTION': arguments.description}
        check_apart([output], [(name, path) for name, path in inputs.items() if path])
    with StopSignals() as signals:
        before = drive_squares(test, believed, signals, _say('as believed', test.count))
        corrected = believed | multipliers(least_squares(before.runs), before, believed)
        after = drive_squares(test, corrected, signals, _say('corrected', test.count))
    first = umbmark(before.runs, test.side, before.geometry.wheel_separation)
    second = umbmark(after.runs, test.side, after.geometry.wheel_separation)
    print('\n'.join(report(test, before, first, second)))
    heading = (
        f'wasd calibrate, {test.description}, {test.count} squares of {test.side:g} m: '
        f'{1e3 * first.largest_error:.2f} mm off before, {1e3 * second.largest_error:.2f} mm after'
    )
    text = to_yaml(corrected, heading)
    print(f'\n{text}', end='')
    if output is not None:
        output.write(text.encode())
        print(f'\nwritten to {output}: wasd mbot --controller {shlex.quote(str(output))}')
    return 0 if second.largest_error <= max(first.largest_error, GOOD) else 1


def multipliers(
    found: Wheels, driven: DrivenSquares, parameters: dict[str, Any]
) -> dict[str, float]:
    """Return the controller's calibration parameters that turn what it believed into this."""
    geometry = driven.geometry
    separation = geometry.wheel_separation / parameters.get(SEPARATION_MULTIPLIER, 1.0)
    return {
        SEPARATION_MULTIPLIER: found.separation / separation,
        LEFT: found.left_radius / geometry.wheel_radius,
        RIGHT: found.right_radius / geometry.wheel_radius,
    }


def report(
    test: SquareTest, before: DrivenSquares, first: Umbmark, second: Umbmark
) -> Sequence[str]:
    """Return a table: the values believed, those by UMBmark, and those by least squares."""
    wheels, exact = before.geometry, least_squares(before.runs)
    believed = Wheels(wheels.left_radius, wheels.right_radius, wheels.wheel_separation)
    columns = (believed, first.correct(believed), exact)
    rows: list[tuple[str, ...]] = [('', 'believed', 'UMBmark', 'least squares')]
    for name, index in (('left radius', 0), ('right radius', 1), ('wheel separation', 2)):
        rows.append((f'{name} [mm]', *(f'{1e3 * wheels[index]:.3f}' for wheels in columns)))
    ratios = (
        ('E_d, right over left', 1.0, first.diameter_ratio, _ratio(exact, believed)),
        ('E_b, wheelbase', 1.0, first.wheelbase_ratio, exact.separation / believed.separation),
    )
    rows += [(name, *(f'{value:.5f}' for value in values)) for name, *values in ratios]
    lines = [f'{name:22}{a:>12}{b:>12}{c:>15}' for name, a, b, c in rows]
    return (
        f'{test.count} squares of {test.side:g} m, half of them each way',
        *lines,
        'UMBmark uses only the ends of squares, for errors of 1 or 2 %; least squares use',
        'the whole path, for any error. The multipliers are those of least squares.',
        f'largest return error: {1e3 * first.largest_error:.2f} mm as believed, '
        f'{1e3 * second.largest_error:.2f} mm corrected',
    )


def _ratio(wheels: Wheels, believed: Wheels) -> float:
    right = wheels.right_radius / believed.right_radius
    return right * believed.left_radius / wheels.left_radius


def to_yaml(parameters: dict[str, Any], heading: str) -> str:
    """Return the file that the controller loads: what it was started with, and the multipliers."""
    plain = {
        key: round(value, 6) if isinstance(value, float) else value
        for key, value in parameters.items()
    }
    body = yaml.safe_dump({NODE_NAME: {'ros__parameters': plain}}, sort_keys=False)
    return f'# {heading}\n{body}'


def _say(what: str, count: int) -> Any:
    def say(number: int) -> None:
        if sys.stderr.isatty():
            end = '' if number + 1 < count else '\r\033[K'
            text = f'\r\033[K{what}: square {number + 1} of {count}'
            offer(sys.stderr, text + end)

    return say


def _read_test(arguments: argparse.Namespace) -> SquareTest:
    for option, value, least, most in (
        ('--side', arguments.side, 0.2, 10.0),
        ('--runs', arguments.runs, 1, 100),
        ('--seed', arguments.seed, 0, 2**31),
    ):
        if not least <= value <= most:
            raise UserError(f'{option}: got {value:g}, wanted {least:g} to {most:g}')
    return SquareTest(
        description=arguments.description,
        package_path=read_folders(arguments.package_path),
        side=arguments.side,
        runs=arguments.runs,
        seed=arguments.seed,
    )


def _read_belief(arguments: argparse.Namespace, test: SquareTest) -> dict[str, Any]:
    """Return the controller's parameters as the command line and its file give them."""
    parameters: dict[str, Any] = {}
    choice = ANY_WHEELS
    if arguments.controller is not None:
        file = read_controller_file(arguments.controller)
        choice = file.parameters.wheel_choice()
        # YAML has lists, where our parameters are tuples.
        parameters = {k: list(v) if isinstance(v, tuple) else v for k, v in file.values.items()}
    for option in ('wheel_separation', 'left_radius', 'right_radius'):
        value = getattr(arguments, option)
        if value is not None and not 0.001 <= value <= 10.0:
            flag = f'--{option.replace("_", "-")}'
            raise UserError(f'{flag}: got {value:g}, wanted metres from 0.001 to 10')
    if arguments.wheel_separation is not None:
        parameters[SEPARATION] = arguments.wheel_separation
    if arguments.left_radius is not None or arguments.right_radius is not None:
        loaded = load_robot(test.description, test.package_path, wheels=choice)
        radius = parameters.get(RADIUS) or find_wheels(loaded.robot, choice).wheel_radius
        for option, key in ((arguments.left_radius, LEFT), (arguments.right_radius, RIGHT)):
            if option is not None:
                parameters[key] = option / radius
    return parameters
