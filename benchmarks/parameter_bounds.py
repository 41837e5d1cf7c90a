# SPDX-License-Identifier: Apache-2.0
"""
Every parameter of the controllers at the ends of its range, and anywhere in it, while they drive.

    python benchmarks/parameter_bounds.py [--file] [--wheels] [--seeds N] [--inner N] [NAME ...]

The Go2 trots at 0.5 m/s and turns; then one parameter is set. It goes on, turns at 1 m/s, stands
still, is told to stand, and trots again. It must be up at the end, without a fall. With `--wheels`
an mbot drives curves, backs and stops; it must stay on its wheels and know where it is. With
`--file` a file gives the parameter before the start.

The items of a list are set all to one end, and each alone; `--inner N` adds values anywhere in the
range. Ranges were found with the seeds from 1 on; those from FIRST_SEED on judge them. Parameters
that go together badly are looked for by `--sets N`: all parameters of the legs at once.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import Field
from functools import partial
import math
from pathlib import Path
import random
import sys
import tempfile
from typing import Any

from diff_drive_sim.parameters import DiffDriveParameters
from experiment import FIRST_SEED
from quadruped_sim.parameters import LegControllerParameters, LegNodeParameters
from trials import Run, simulate, Trace
import wasd
from wasd_core.errors import UserError
from wasd_core.parameter_file import NodeKind, read_parameters
from wasd_core.parameters import Known, known_parameters, numeric_ends
import yaml

# What is done with the parameter: a trot in which it is set, a faster one, a stand, a trot.
SET_AT = 3.6
KEYS = '0.1 2\n2.6 5\n7.0 2\n7.8 5\n'
TWIST = '3.0 0.5 0 0.8\n4.2 1.0 0 1.0\n6.3 0 0 0\n8.0 0.8 0 -0.6\n'
DURATION = 9.3
# A Go2 that walks like this has not fallen, but it soon will [deg], [m].
TILTED, LOW = 25.0, 0.12
# How wheels are driven: ahead [m/s], turn [rad/s], and for how long [s].
DRIVE = ((0.3, 0.5, 1.0), (0.6, -1.0, 1.0), (-0.3, 2.0, 1.0), (0.0, 0.0, 0.5))

KNOWN = known_parameters(LegControllerParameters)
# A script drives wheels with motors; frames and joints have names, no range.
WHEELS = {
    name: known
    for name, known in known_parameters(DiffDriveParameters).items()
    if name not in ('mode', 'legacy', 'controller', 'description')
    and known.field.default not in ((), '', 'odom')
}
# What is wrong with one run, '' if nothing is.
Trial = Callable[[], str]


def ends_of(field: 'Field[Any]') -> dict[str, Any]:
    """Return the values at the ends of a parameter's range, by what they are called."""
    if isinstance(field.default, bool):
        return {'false': False, 'true': True}
    if isinstance(field.default, str):
        return {choice: choice for choice in field.metadata['choices']}
    low, high = numeric_ends(field)
    ends = {'low': low, 'high': high}
    if field.metadata['nan']:
        ends['nan'] = math.nan
    if isinstance(low, float) and low == 0.0:
        ends['least'] = math.ulp(0.0)  # what is divided by it is no number
    if not isinstance(field.default, tuple):
        return ends
    for end, values in list(ends.items()):
        for index, value in enumerate(values):
            alone = list(field.default)
            alone[index] = value
            ends[f'{end} [{index}]'] = tuple(alone)
    return ends


def drawn(field: 'Field[Any]', chance: random.Random) -> Any:
    """Return a value anywhere in a parameter's range."""
    if isinstance(field.default, (bool, str)):
        return chance.choice(list(ends_of(field).values()))
    low, high = numeric_ends(field)
    if isinstance(field.default, tuple):
        return tuple(chance.uniform(*pair) for pair in zip(low, high, strict=True))
    return (
        chance.randint(low, high) if isinstance(field.default, int) else chance.uniform(low, high)
    )


def in_file(name: str, value: Any, read: Callable[[str], Any]) -> Any:
    """Return what `read` makes of a file with one parameter."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'parameters.yaml')
        path.write_text(yaml.safe_dump({name: list(value) if type(value) is tuple else value}))
        return read(str(path))


def walk(seed: int, *settings: tuple[str, Any]) -> Run:
    """Return a run in which parameters are set one after the other, at once."""
    tunes = tuple((SET_AT, name, value) for name, value in settings)
    return Run(seed=seed, keys=KEYS, twist=TWIST, duration=DURATION, tunes=tunes)


def walk_by_file(seed: int, name: str, value: Any) -> Run:
    """Return a run of a robot whose file gives a parameter."""
    kind = NodeKind('leg_controller', 'leg controller')
    read = in_file(name, value, lambda path: read_parameters(path, LegNodeParameters, kind))
    assert read == {name: value}, f'{read} in place of {value}'
    return Run(
        seed=seed, keys=KEYS, twist=TWIST, duration=DURATION, tunes=((0.0, name, read[name]),)
    )


def verdict(trace: Trace) -> str:
    """Return what is wrong with a walk, '' if nothing is."""
    rows = trace.after(SET_AT)
    tilt = math.degrees(float(abs(trace.rpy[rows, :2]).max()))
    assert trace.felt is not None
    height = float(trace.felt.clearance[rows].min())
    if not trace.is_up or 'passive' in trace.state[rows]:
        return f'FELL: ends {trace.state[-1]} with {trace.report["falls"]} falls'
    if tilt > TILTED or height < LOW:
        return f'near: tilts {tilt:.0f} deg, {100 * height:.0f} cm high'
    return ''


def judged(run: Run) -> str:
    """Return what is wrong with a run, '' if nothing is."""
    return attempted(lambda: verdict(simulate(run)))


def attempted(trial: Trial) -> str:
    """Return what is wrong with a trial, which may be that it breaks."""
    try:
        return trial()
    except UserError as error:
        return f'refused: {error}'
    except Exception as error:  # an experiment that looks for just those goes on
        return f'BROKE: {type(error).__name__}: {error}'


def drive(name: str, value: Any, seed: int, *, by_file: bool) -> str:
    """Drive an mbot with a parameter; return what is wrong, '' if nothing is."""
    if by_file:
        robot = in_file(name, value, lambda path: wasd.Mbot(seed=seed, controller=path))
    else:
        robot = wasd.Mbot(seed=seed)
    for leg, (ahead, turn, seconds) in enumerate(DRIVE):
        robot.drive(ahead, turn)
        robot.run(seconds)
        if leg == 0 and not by_file:
            robot._robot.drive_unit.parameters = robot._robot.drive_unit.parameters.changed(
                {name: value}
            )
    kept, truth = robot._robot.drive_unit.parameters.value(name), robot.truth
    if kept != value and not (kept != kept and value != value):
        return f'CHANGED: {kept} in place of {value}'
    known = (*robot.odometry[:3], *truth.position, *truth.planar_velocity)
    if not all(map(math.isfinite, known)):
        return f'NAN: {known}'
    upright = 1.0 - 2.0 * float(truth.orientation[1] ** 2 + truth.orientation[2] ** 2)
    return '' if upright > math.cos(math.radians(TILTED)) else f'FELL: up is {upright:.2f}'


def values_of(
    known: Mapping[str, Known], names: list[str], first: int, inner: int
) -> Iterator[tuple[str, str, Any]]:
    """Yield name, what it is called, and value of all that is tried."""
    for name in names:
        field = known[name].field
        chance = random.Random(f'{name} {first}')
        more = {f'inside {n}': drawn(field, chance) for n in range(inner)}
        for what, value in {**ends_of(field), **more}.items():
            yield name, what, value


def sets(count: int, first: int) -> Iterator[tuple[str, Run]]:
    """Yield trials of all parameters at once, anywhere in their ranges."""
    for seed in range(first, first + count):
        chance = random.Random(seed)
        settings = [
            (name, drawn(known.field, chance))
            for name, known in KNOWN.items()
            if known.group != 'jump'  # its two go together or not
        ]
        yield f'set {seed}', walk(seed, *settings)


def trials_of(asked: argparse.Namespace) -> Iterator[tuple[str, Trial]]:
    """Yield every trial with what it is called."""
    if asked.sets:
        for what, run in sets(asked.sets, asked.first):
            yield what, partial(judged, run)
        return
    known = WHEELS if asked.wheels else KNOWN
    if asked.wheels and not asked.file:
        known = {n: one for n, one in known.items() if not one.field.metadata['read_only']}
    names = [n for n in known if not asked.names or any(part in n for part in asked.names)]
    for name, what, value in values_of(known, names, asked.first, asked.inner):
        for seed in range(asked.first, asked.first + asked.seeds):
            called = f'{name} {what} = {value} seed {seed}'
            if asked.wheels:
                yield called, partial(drive, name, value, seed, by_file=asked.file)
            elif asked.file:
                yield called, partial(_walk_by_file, seed, name, value)
            else:
                yield called, partial(judged, walk(seed, (name, value)))


def _walk_by_file(seed: int, name: str, value: Any) -> str:
    return verdict(simulate(walk_by_file(seed, name, value)))


def main() -> int:
    """Run what is asked for; print what fails, and the sums."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('names', nargs='*', help='parts of names of parameters; none: all')
    parser.add_argument('--file', action='store_true', help='a file gives them')
    parser.add_argument('--wheels', action='store_true', help='of wheels, not of legs')
    parser.add_argument('--seeds', type=int, default=1)
    parser.add_argument('--first', type=int, default=FIRST_SEED)
    parser.add_argument('--inner', type=int, default=0, help='values anywhere in the range')
    parser.add_argument('--sets', type=int, default=0, help='all parameters at once, so often')
    asked = parser.parse_args()
    count = bad = refused = 0
    for what, trial in trials_of(asked):
        found, count = attempted(trial), count + 1
        if found:
            refused += found.startswith('refused')
            bad += not found.startswith(('near', 'refused'))
            print(f'{what}: {found}', flush=True)
    print(f'{count - bad} of {count} held, {refused} of them refused')
    return int(bad > 0)


if __name__ == '__main__':
    sys.exit(main())
