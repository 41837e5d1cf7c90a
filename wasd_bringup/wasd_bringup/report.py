# SPDX-License-Identifier: Apache-2.0
"""What happened in a run: 50 samples a second of command, truth and odometry, written as JSON."""

from collections.abc import Sequence
import json
import math
import os
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from mujoco_sim.statistics import TickSummary
from mujoco_sim.world import FALL_TILT
from mujoco_sim.world import World

SCHEMA = 1
SAMPLE_PERIOD = 0.02


class Sample(NamedTuple):
    """What a robot's controller says of one instant."""

    state: str
    command: tuple[float, float, float]  # the command in force: vx, vy [m/s], wz [rad/s]
    odometry: tuple[float, float, float]  # x, y [m], yaw [rad]
    contacts: Sequence[int]  # 1 where a foot or wheel touches
    is_down: bool = False  # a legged robot whose trunk has come to the ground


class Recorder:
    """
    Collects samples and counts falls; `sample` is called every SAMPLE_PERIOD of simulated time.

    A fall is a tilt over 60 degrees, or a trunk on the ground; it ends when that has ended.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.falls = 0
        self.fell_at: float | None = None
        self._fallen = False
        self.samples: dict[str, list[Any]] = {
            key: []
            for key in (
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
        }

    def sample(self, now: Sample) -> None:
        """Add the sample of this instant."""
        base = self._world.base()
        self._watch_for_falls(base.tilt > FALL_TILT or now.is_down)
        x, y, yaw = now.odometry
        row = {
            't': round(self._world.time, 9),
            'state': now.state,
            'command': list(now.command),
            'position': base.position.tolist(),
            'rpy': base.rpy.tolist(),
            'velocity': base.planar_velocity.tolist(),
            'odom': [x, y, wrap(yaw)],
            'contacts': list(now.contacts),
            'torque_max': float(self._world.take_peak_effort().max(initial=0.0)),
        }
        for key, value in row.items():
            self.samples[key].append(value)

    def _watch_for_falls(self, is_down: bool) -> None:
        if is_down and not self._fallen:
            self.falls += 1
            if self.fell_at is None:
                self.fell_at = round(self._world.time, 9)
        self._fallen = is_down


def build_report(
    recorder: Recorder, run: dict[str, Any], sim_time: float, wall_time: float, ticks: TickSummary
) -> dict[str, Any]:
    """Return the report of a run; `run` is what was asked for: robot, world, seed, estimator."""
    return {
        'schema': SCHEMA,
        **run,
        'sim_time': round(sim_time, 9),
        'wall_time': round(wall_time, 3),
        'real_time_factor': round(sim_time / wall_time, 3) if wall_time > 0.0 else 0.0,
        'tick': ticks._asdict(),
        'falls': recorder.falls,
        'fell_at': recorder.fell_at,
        'samples': recorder.samples,
    }


def join_reports(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return one report of a run of several robots: what they share, and that of each by name."""
    shared = ('schema', 'world', 'seed', 'sim_time', 'wall_time', 'real_time_factor')
    return {
        **{key: reports[0][key] for key in shared},
        'robot': 'both',
        'robots': {report['robot']: report for report in reports},
    }


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write a report whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.absolute().parent, prefix=f'.{path.name}.')
    try:
        with os.fdopen(handle, 'w', encoding='utf-8') as file:
            file.write(json.dumps(report))  # ten times as fast as json.dump
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def wrap(angle: float) -> float:
    """Return an angle [rad] between -pi and pi."""
    return math.remainder(angle, 2.0 * math.pi)
