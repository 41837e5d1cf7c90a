# SPDX-License-Identifier: Apache-2.0
"""Benchmark of descriptions: how fast ours loads, how many of other people's do, and how true."""

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
import tempfile
from typing import Any

from mujoco_sim.world import build_world
from robot_description.description import load_robot
from robot_description.info import check_kinematics
from robot_description.packages import share_directory
from table import at_most, Row
from wasd_core.errors import UserError

# What a process of its own runs: a world with the Go2 and all that is drawn of it.
LOAD = """
import time
from mujoco_sim.world import build_world
from robot_description.description import load_robot
begin = time.perf_counter()
world = build_world(load_robot('go2'), visuals=True)
print(time.perf_counter() - begin, world.model.nmesh)
"""
MESHES = 7
QUADRUPEDS = ('a1', 'b1', 'go1', 'go2')


def load_go2(cache: Path) -> float:
    """Return how long a new process takes to load the Go2 with its meshes [s]."""
    done = subprocess.run(
        [sys.executable, '-c', LOAD],
        env={**os.environ, 'XDG_CACHE_HOME': str(cache)},
        check=True,
        capture_output=True,
        text=True,
    )
    seconds, meshes = done.stdout.split()
    assert int(meshes) == MESHES, done.stdout
    return float(seconds)


def loading(count: int) -> list[Row]:
    """Load the Go2 with an empty mesh cache and with a full one."""
    first, cached = [], []
    for _ in range(count):
        with tempfile.TemporaryDirectory() as folder:
            first.append(load_go2(Path(folder)))
            cached.append(load_go2(Path(folder)))
    return [
        at_most('describe: Go2 with visual meshes, first time', first, 's', 2.0),
        at_most('describe: Go2 with visual meshes, cached', cached, 's', 0.5),
    ]


def load_other(path: Path) -> dict[str, Any]:
    """Load one robot with all that is drawn of it; say how far its mass is off, or why not."""
    trial: dict[str, Any] = {'robot': path.stem}
    try:
        loaded = load_robot(str(path))
        model = build_world(loaded, visuals=True).model
        trial['mass_off'] = abs(float(model.body_mass.sum()) - loaded.robot.mass)
    except UserError as error:
        trial['refused'] = str(error)
    trial['passed'] = trial.get('mass_off', 0.0) <= 1e-6
    return trial


def others() -> Row:
    """Load every URDF of example-robot-data."""
    files = sorted((share_directory('example-robot-data') / 'robots').rglob('*.urdf'))
    trials = [load_other(path) for path in files]
    refused = sum('refused' in trial for trial in trials)
    worst = max(trial.get('mass_off', 0.0) for trial in trials)
    return Row(
        what='describe: URDFs of example-robot-data into MuJoCo',
        measured=f'{len(files) - refused} of {len(files)}; mass off {worst:.0e} kg at most',
        must='each loads, mass within 1e-6 kg, or is refused in one line',
        passed=all(trial['passed'] for trial in trials),
        trials=trials,
    )


def kinematics() -> Row:
    """Compare all links of ours and of other quadrupeds in three libraries."""
    folder = share_directory('example-robot-data') / 'robots'
    names = ['go2', 'mbot']
    names += [str(folder / f'{name}_description/urdf/{name}.urdf') for name in QUADRUPEDS]
    trials: list[dict[str, Any]] = []
    for name in names:
        loaded = load_robot(name)
        deviations = check_kinematics(loaded)
        rows = [deviation._asdict() for deviation in deviations]
        trials.append({'robot': Path(name).stem, 'deviations': rows})
    worst = max(row['distance'] for trial in trials for row in trial['deviations'])
    return Row(
        what='describe: links in MuJoCo, Pinocchio, yourdfpy, 6 robots',
        measured=f'{worst:.0e} m apart at most',
        must='<= 1e-6 m',
        passed=worst <= 1e-6,
        trials=trials,
    )


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of the benchmark."""
    note('describe: loading the Go2')
    rows = loading(3 if quick else 5)
    note('describe: kinematics')
    rows.append(kinematics())
    note('describe: the robots of others')
    rows.append(others())
    return rows
