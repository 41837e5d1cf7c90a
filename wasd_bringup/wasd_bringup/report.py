# SPDX-License-Identifier: Apache-2.0
"""What happened in a run: 50 samples a second of command, truth and odometry, written as JSON."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import json
import math
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from mujoco_sim.simulation import TickSummary
from mujoco_sim.world import FALL_TILT, World
from wasd_core.errors import one_line, UserError
from wasd_core.output_file import OutputFile

from wasd_bringup.robots import BOTH

# Bytes that are copied at a time.
PIECE = 1 << 20
# Samples that are written at a time: two seconds of them.
AT_ONCE = 100


class Samples(Mapping[str, list[Any]]):
    """
    Columns of values that JSON knows; reads like a dictionary of lists, made anew at each look.

    The files have no names, so that nothing is left behind, however the process ends.
    """

    def __init__(self, columns: tuple[str, ...]) -> None:
        self._files = {name: tempfile.TemporaryFile() for name in columns}  # noqa: SIM115
        self._waiting: list[Mapping[str, Any]] = []
        self._is_empty = True

    def add(self, row: Mapping[str, Any]) -> None:
        """
        Add a value to each column; they are written some at a time, then and before a look.

        Raises:
            UserError: the folder for temporary files is full, or the like; so does a look.
        """
        self._waiting.append(row)
        if len(self._waiting) >= AT_ONCE:
            self._write()

    def _write(self) -> None:
        """Write what waits: many values at once cost a tenth of what they cost one by one."""
        if not self._waiting:
            return
        rows, self._waiting = self._waiting, []
        separator = '' if self._is_empty else ', '
        self._is_empty = False
        try:
            for name, file in self._files.items():
                values = json.dumps([row[name] for row in rows])[1:-1]
                file.write(f'{separator}{values}'.encode())
        except OSError as error:
            folder = tempfile.gettempdir()
            raise UserError(f'{folder}: no room for a report: {one_line(error)}') from None

    def json_pieces(self) -> Iterator[bytes]:
        """Yield the bytes that json.dumps would make of the columns."""
        self._write()
        for index, (name, file) in enumerate(self._files.items()):
            yield f'{", " if index else "{"}{json.dumps(name)}: ['.encode()
            file.seek(0)
            while piece := file.read(PIECE):
                yield piece
            yield b']'
        yield b'}'

    def __getitem__(self, name: str) -> list[Any]:
        """Return a column."""
        self._write()
        file = self._files[name]
        file.seek(0)
        values: list[Any] = json.loads(b'[' + file.read() + b']')
        return values

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the columns' names."""
        return iter(self._files)

    def __len__(self) -> int:
        """Return how many columns there are."""
        return len(self._files)

    def close(self) -> None:
        """Forget everything."""
        for file in self._files.values():
            with contextlib.suppress(OSError):  # what was kept back does not fit
                file.close()


SCHEMA = 1
SAMPLE_PERIOD = 0.02
UP_AGAIN = 25
COLUMNS = (
    't',
    'state',
    'command',
    'position',
    'rpy',
    'velocity',
    'odom',
    'contacts',
    'torque_max',
)


class Sample(NamedTuple):
    """What a robot's controller says of one instant."""

    state: str
    command: tuple[float, float, float]  # the command in force: vx, vy [m/s], wz [rad/s]
    odometry: tuple[float, float, float]  # x, y [m], yaw [rad]
    contacts: Sequence[int]  # 1 where a foot or wheel touches
    is_down: bool = False  # a legged robot that has gone down, see `TrunkWatch`


# States in which the trunk may be on the ground: nobody has made it fall.
LYING = ('passive', 'get up', 'lie down')


class TrunkWatch:
    """
    Tells when a legged robot has gone down, against the driver's will.

    State: for how many samples it has been off the ground. One that rises bounces on its trunk.
    """

    def __init__(self) -> None:
        self._off_for, self._was_up = 0, False

    def is_down(self, touches: bool, state: str, event: str | None) -> bool:
        """
        Whether it is down; `touches` tells that its trunk is on the ground, or that it knows of a
        fall itself, in a state, which an `event` has led to.
        """
        self._off_for = 0 if touches or state in LYING else self._off_for + 1
        if self._off_for >= UP_AGAIN:
            self._was_up = True
        elif state in LYING and (event is None or not touches):
            self._was_up = False
        return touches and self._was_up


class Recorder:
    """
    Counts falls, and keeps samples if asked; `sample` is called every SAMPLE_PERIOD [s].

    A fall is a tilt over 60 degrees, a trunk on the ground, or one that the robot itself lets go
    for; who lies down or is let go of by key has not fallen. It ends when that has ended for
    UP_AGAIN samples: a robot that bounces has fallen once.
    """

    def __init__(self, world: World, keep: bool = True) -> None:
        self._world = world
        self.falls = 0
        self.fell_at: float | None = None
        self._up_for = UP_AGAIN
        self.samples = Samples(COLUMNS) if keep else None

    def sample(self, now: Sample) -> None:
        """
        Add the sample of this instant.

        Raises:
            UserError: there is no room for it.
        """
        base = self._world.base()
        self._watch_for_falls(base.tilt > FALL_TILT or now.is_down)
        if self.samples is None:
            return
        x, y, yaw = now.odometry
        row = {
            't': round(self._world.time, 9),
            'state': now.state,
            'command': list(now.command),
            'position': base.position.tolist(),
            'rpy': base.rpy.tolist(),
            'velocity': base.planar_velocity.tolist(),
            'odom': [x, y, math.remainder(yaw, 2.0 * math.pi)],
            'contacts': list(now.contacts),
            'torque_max': float(self._world.take_peak_effort().max(initial=0.0)),
        }
        self.samples.add(row)

    def close(self) -> None:
        """Forget the samples."""
        if self.samples is not None:
            self.samples.close()

    def _watch_for_falls(self, is_down: bool) -> None:
        if is_down and self._up_for >= UP_AGAIN:
            self.falls += 1
            if self.fell_at is None:
                self.fell_at = round(self._world.time, 9)
        self._up_for = 0 if is_down else self._up_for + 1


def build_report(
    recorder: Recorder, run: dict[str, Any], sim_time: float, wall_time: float, ticks: TickSummary
) -> dict[str, Any]:
    """
    Return the report of a run; `run` is what was asked for: robot, world, seed, estimator.

    Its samples are empty if none were kept; else they can be read until the recorder is closed.
    """
    return {
        'schema': SCHEMA,
        **run,
        'sim_time': round(sim_time, 9),
        'wall_time': round(wall_time, 3),
        'real_time_factor': round(sim_time / wall_time, 3) if wall_time > 0.0 else 0.0,
        'tick': ticks._asdict(),
        'falls': recorder.falls,
        'fell_at': recorder.fell_at,
        'samples': {} if recorder.samples is None else recorder.samples,
    }


def join_reports(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return one report of a run of several robots: what they share, and that of each by name."""
    shared = ('schema', 'world', 'seed', 'sim_time', 'wall_time', 'real_time_factor')
    return {
        **{key: reports[0][key] for key in shared},
        'robot': BOTH,
        'robots': {report['robot']: report for report in reports},
    }


def write_report(report: dict[str, Any], file: OutputFile | Path) -> None:
    """
    Write a report whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    output = OutputFile(file, '--report') if isinstance(file, Path) else file
    output.write(report_pieces(report))


def report_pieces(report: dict[str, Any]) -> Iterator[bytes]:
    """Yield the bytes of a report as json.dumps makes them, a piece of its samples at a time."""
    found: list[Samples] = []
    mark = '\0samples'  # as a name of anything else it could not be given

    def stand_in(value: Any) -> str:
        if not isinstance(value, Samples):
            raise TypeError(f'{type(value).__name__} is not for JSON')
        found.append(value)
        return mark

    first, *rest = json.dumps(report, default=stand_in).split(json.dumps(mark))
    yield first.encode()
    for samples, text in zip(found, rest, strict=True):
        yield from samples.json_pieces()
        yield text.encode()
