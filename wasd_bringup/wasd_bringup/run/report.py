# SPDX-License-Identifier: Apache-2.0
"""What happened in a run: 50 samples a second of command, truth and odometry, written as JSON."""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
import json
import math
from typing import Any, NamedTuple

from mujoco_sim.simulation import TickSummary
from mujoco_sim.world import FALL_TILT, World

from wasd_bringup.robots import BOTH

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
SCALARS = ('t', 'state', 'torque_max')


class Samples(Mapping[str, list[Any]]):
    """
    Columns of a run; each access reads one column, a list of numbers, texts or rows of numbers.

    A number takes eight bytes, so that an hour of samples takes about 30 MB.
    """

    def __init__(self) -> None:
        self._columns: dict[str, Any] = {name: array('d') for name in COLUMNS}
        self._columns |= {'state': [], 'contacts': array('b')}
        self._count = 0

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a value to each column; rows of one column have one length."""
        for name, column in self._columns.items():
            column.extend([row[name]] if name in SCALARS else row[name])
        self._count += 1

    def __getitem__(self, name: str) -> list[Any]:
        """Return a column."""
        values = list(self._columns[name])
        if name in SCALARS or not self._count:
            return values
        width = len(values) // self._count
        return [values[width * index : width * (index + 1)] for index in range(self._count)]

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the columns' names."""
        return iter(self._columns)

    def __len__(self) -> int:
        """Return how many columns there are."""
        return len(self._columns)


SCHEMA = 1
SAMPLE_PERIOD = 0.02
UP_AGAIN = 25


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
        self.samples = Samples() if keep else None

    def sample(self, now: Sample) -> None:
        """Add the sample of this instant."""
        base = self._world.base()
        is_down = base.tilt > FALL_TILT or now.is_down
        if is_down and self._up_for >= UP_AGAIN:
            self.falls += 1
            if self.fell_at is None:
                self.fell_at = round(self._world.time, 9)
        self._up_for = 0 if is_down else self._up_for + 1
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
            'torque_max': float(self._world.actuation.take_peak_effort().max(initial=0.0)),
        }
        self.samples.add(row)


def build_report(
    recorder: Recorder, run: dict[str, Any], sim_time: float, wall_time: float, ticks: TickSummary
) -> dict[str, Any]:
    """
    Return the report of a run; `run` is what was asked for: robot, world, seed, estimator.

    Its samples are empty if none were kept.
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


def to_json(report: dict[str, Any]) -> bytes:
    """Return a report as JSON; columns become lists one at a time, which take much memory."""

    def plain(value: Any) -> Any:
        if isinstance(value, Samples):
            return {name: partial(value.__getitem__, name) for name in value}
        return value()

    return json.dumps(report, default=plain).encode()
