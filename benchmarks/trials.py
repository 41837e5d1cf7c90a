# SPDX-License-Identifier: Apache-2.0
"""Runs of a quadruped, in this process or as `wasd go2`, and what their reports say."""

from dataclasses import dataclass, replace
import hashlib
import json
import math
from pathlib import Path
import subprocess
import sys
import tempfile
from typing import Any

from environment import alone
import numpy as np
from walking import Felt, Walk

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
# A run that takes longer than this has hung [s].
PATIENCE = 900.0
# What a report says of the machine; the rest is simulated.
OF_THE_MACHINE = ('wall_time', 'real_time_factor', 'tick')
# Key 2 at 0.1 s, standing at 2.1 s, move base at 2.6 s, first velocity at START [s].
KEYS = '0.1 2\n2.6 5\n'
START = 3.0


class RunFailed(Exception):
    """A run did not write its report."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run of a quadruped: what it is told, in which world, with which seed."""

    seed: int
    twist: str = ''  # a --twist script
    keys: str = KEYS  # a --play script
    duration: float
    world: str = 'flat'
    estimator: str = 'kalman'
    push: str = ''  # as --push reads it; several with ';' between
    description: str = ''  # a file; '' is the Go2
    friction: float | None = None
    payload: str = ''
    randomise: float = 0.0
    tumbled: float | None = None  # begins anyhow, at this x [m]
    parameters: tuple[tuple[str, Any], ...] = ()  # of the controller, `group.name` and value
    tunes: tuple[tuple[float, str, Any], ...] = ()  # time [s], name and value, while it runs
    command: bool = False  # as `wasd go2`, in a process of its own
    speed: float = 0.0  # of `wasd go2`
    repeat: int = 0  # tells a run from another that is the same


@dataclass(frozen=True)
class Trace:
    """What happened in a run: truth unless said, rows at 50 Hz; SI, angles in radians."""

    run: Run
    report: dict[str, Any]  # without its samples
    digest: str  # of all that is simulated: equal for equal reports
    t: np.ndarray  # (n,)
    state: list[str]
    position: np.ndarray  # (n, 3)
    rpy: np.ndarray  # (n, 3)
    velocity: np.ndarray  # ahead, to the left, turn, (n, 3)
    command: np.ndarray  # in force, as the velocity, (n, 3)
    odometry: np.ndarray  # x, y, yaw, (n, 3)
    contacts: np.ndarray  # 1 where a foot touches, (n, 4)
    torque: np.ndarray  # largest of any motor since the row before, (n,)
    felt: Felt | None = None  # of a run in this process

    @property
    def is_up(self) -> bool:
        """Whether it never fell and was still being driven at the end."""
        return self.report['falls'] == 0 and self.state[-1] in ('move base', 'trotting')

    @property
    def tilt(self) -> float:
        """The largest roll or pitch [deg]."""
        return math.degrees(float(np.abs(self.rpy[:, :2]).max()))

    def after(self, time: float) -> slice:
        """Return the rows from a simulated time on."""
        return slice(int(np.searchsorted(self.t, time - 1e-6)), None)

    def mean_velocity(self, begin: float) -> np.ndarray:
        """Return the mean velocity from a time on, shape (3,)."""
        mean: np.ndarray = self.velocity[self.after(begin)].mean(axis=0)
        return mean

    @property
    def path(self) -> float:
        """Length of the way walked since the first velocity, in the plane [m]."""
        steps = np.diff(self.position[self.after(START), :2], axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    @property
    def odometry_error(self) -> float:
        """Distance between where odometry and truth went since the first velocity [m]."""
        rows = self.after(START)
        seen, true = self.odometry[rows, :2], self.position[rows, :2]
        return math.dist(seen[-1] - seen[0], true[-1] - true[0])

    def record(self, passed: bool, **values: float | str | None) -> dict[str, Any]:
        """Return this run as one trial of the JSON."""
        run = self.run
        asked = {'seed': run.seed, 'world': run.world, 'estimator': run.estimator}
        if run.description:
            asked['description'] = Path(run.description).name
        for name in ('friction', 'payload', 'randomise', 'push'):
            if getattr(run, name):
                asked[name] = getattr(run, name)
        seen = {'up': self.is_up, 'falls': self.report['falls'], 'state': self.state[-1]}
        seen['fell_at'] = self.report['fell_at']
        return {**asked, 'passed': passed, **seen, **values}


def simulate(run: Run) -> Trace:
    """
    Run the robot and return what happened.

    Raises:
        RunFailed: as a command it wrote no report.
    """
    if run.command:
        return _simulate_command(run)
    report, felt = Walk(run).report()
    return to_trace(run, report, felt)


def _simulate_command(run: Run) -> Trace:
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, 'report.json')
        words = [*WASD, 'go2', '--viewer', 'none']
        for option, text in (('--play', run.keys), ('--twist', run.twist)):
            path = Path(folder, option.strip('-'))
            path.write_text(text)
            words += [option, str(path)] if text else []
        words += ['--push', run.push] if run.push else []
        words += ['--description', run.description] if run.description else []
        words += ['--world', run.world, '--seed', str(run.seed), '--estimator', run.estimator]
        for option in ('friction', 'payload', 'randomise'):
            value = getattr(run, option)
            words += [f'--{option}', str(value)] if value else []
        words += ['--duration', str(run.duration), '--speed', str(run.speed)]
        words += ['--report', str(report)]
        finished = subprocess.run(
            words,
            env=alone(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        if finished.returncode or not report.exists():
            raise RunFailed(f'exit status {finished.returncode}: {finished.stderr.strip()[-300:]}')
        return to_trace(run, json.loads(report.read_text()))


def to_trace(run: Run, report: dict[str, Any], felt: Felt | None = None) -> Trace:
    """Return a report with its samples as arrays."""
    same = {key: value for key, value in report.items() if key not in OF_THE_MACHINE}
    digest = hashlib.sha256(json.dumps(same, sort_keys=True).encode()).hexdigest()
    samples = report.pop('samples')
    names = ('position', 'rpy', 'velocity', 'command', 'odom', 'contacts', 'torque_max')
    arrays: list[Any] = [np.array(samples[name]) for name in names]
    trace = Trace(run, report, digest, np.array(samples['t']), samples['state'], *arrays)
    return replace(trace, felt=felt)
