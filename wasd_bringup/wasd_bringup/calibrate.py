# SPDX-License-Identifier: Apache-2.0
"""`wasd calibrate`: what the wheels really are, from squares driven both ways (UMBmark)."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import Any

from diff_drive_sim.controller_file import NODE_NAME
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.geometry import find_wheels
from diff_drive_sim.umbmark import least_squares
from diff_drive_sim.umbmark import Umbmark
from diff_drive_sim.umbmark import umbmark
from diff_drive_sim.umbmark import Wheels
from robot_description.description import load_robot
from wasd_core.output_file import check_apart
from wasd_core.output_file import OutputFile
from wasd_core.signals import StopSignals
from wasd_core.streams import offer
import yaml

from wasd_bringup.discovery_range import keep_alone
from wasd_bringup.errors import UsageError
from wasd_bringup.square_runs import drive_squares
from wasd_bringup.square_runs import DrivenSquares
from wasd_bringup.square_runs import SquareTest

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
    keep_alone()
    with StopSignals() as signals:
        before = drive_squares(test, believed, signals, _say('as believed', test.count))
        corrected = believed | multipliers(least_squares(before.runs), before, believed)
        after = drive_squares(test, corrected, signals, _say('corrected', test.count))
    first = umbmark(before.runs, test.side, before.geometry.wheel_separation)
    second = umbmark(after.runs, test.side, after.geometry.wheel_separation)
    print('\n'.join(report(test, before, first, second)))
    text = to_yaml(corrected, _heading(test, first, second))
    print(f'\n{text}', end='')
    if output is not None:
        output.write(text.encode())
        print(f'\nwritten to {output}: wasd mbot --controller {output}')
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
    """Return a table: what was believed, what UMBmark and what least squares make of it."""
    believed, exact = before.believed, least_squares(before.runs)
    columns = (believed, first.corrected(believed), exact)
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
        'UMBmark knows only where squares end and is for errors of 1 or 2 %; least squares know',
        'the whole path and are for any error. The multipliers are by least squares.',
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


def _heading(test: SquareTest, first: Umbmark, second: Umbmark) -> str:
    return (
        f'wasd calibrate, {test.description}, {test.count} squares of {test.side:g} m: '
        f'{1e3 * first.largest_error:.2f} mm off before, {1e3 * second.largest_error:.2f} mm after'
    )


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
            raise UsageError(f'{option}: got {value:g}, wanted {least:g} to {most:g}')
    for folder in arguments.package_path:
        if not Path(folder).is_dir():
            raise UsageError(f'--package-path {folder}: no such folder')
    return SquareTest(
        description=arguments.description,
        package_path=tuple(Path(folder).resolve() for folder in arguments.package_path),
        side=arguments.side,
        runs=arguments.runs,
        seed=arguments.seed,
    )


def _read_belief(arguments: argparse.Namespace, test: SquareTest) -> dict[str, Any]:
    """Return the controller's parameters as the command line and its file give them."""
    parameters: dict[str, Any] = {}
    if arguments.controller is not None:
        # YAML has lists, where our parameters are tuples.
        given = read_controller_file(arguments.controller).values
        parameters = {key: list(v) if isinstance(v, tuple) else v for key, v in given.items()}
    for option in ('wheel_separation', 'left_radius', 'right_radius'):
        value = getattr(arguments, option)
        if value is not None and not 0.001 <= value <= 10.0:
            flag = f'--{option.replace("_", "-")}'
            raise UsageError(f'{flag}: got {value:g}, wanted metres from 0.001 to 10')
    if arguments.wheel_separation is not None:
        parameters[SEPARATION] = arguments.wheel_separation
    if arguments.left_radius is not None or arguments.right_radius is not None:
        loaded = load_robot(test.description, test.package_path)
        radius = parameters.get(RADIUS) or find_wheels(loaded.robot).wheel_radius
        for option, key in ((arguments.left_radius, LEFT), (arguments.right_radius, RIGHT)):
            if option is not None:
                parameters[key] = option / radius
    return parameters
