# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of quadrupeds that nobody tuned for: they stand up from lying and follow velocities.

Each is told the Go2's speeds times the square root of its legs' length (equal Froude numbers):
ahead for 10 s, then sideways and on the spot. Control runs on the estimator; what is measured is
the truth.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from cores import simulate_all
from experiment import Experiment, judged, seeds, Trial, worst
from legs_states import get_up
import numpy as np
from robot_description.description import read_description
from robot_description.morphology.quadruped import Scale, scale_of
from robot_description.packages import share_directory
from table import format_count, Row
from trials import Run, START, Trace
from wasd_core.errors import UserError

# In example-robot-data, which the project installs.
ROBOTS = {
    'a1': 'a1_description/urdf/a1.urdf',
    'go1': 'go1_description/urdf/go1.urdf',
    'go2 (flat URDF)': 'go2_description/urdf/go2.urdf',
    'b1': 'b1_description/urdf/b1.urdf',
    'laikago': 'laikago_description/urdf/laikago.urdf',
    'solo12': 'solo_description/robots/solo12.urdf',
    'hyq': 'hyq_description/robots/hyq_no_sensors.urdf',
    'anymal b': 'anymal_b_simple_description/robots/anymal.urdf',
    'anymal c': 'anymal_c_simple_description/urdf/anymal.urdf',
}
# So many of them in a quick benchmark.
QUICK_ROBOTS = 4
# Velocity on the Go2 (ahead, left [m/s], turn [rad/s]) and for how long [s].
LEGS_OF_THE_WALK = (((0.8, 0.0, 0.0), 10.0), ((0.0, 0.3, 0.0), 5.0), ((0.0, 0.0, 0.6), 5.0))
# Of each of them so long is left out at the beginning [s].
SETTLE = 2.0
# Axis, begin and end [s] of a leg of the walk, and the velocity along the axis.
Span = tuple[int, float, float, float]
MUST = 'velocity <= 10 %, no fall'
# Descriptions given on the command line.
more: list[str] = []


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Walk every robot that is there and return the rows; `note` is told how far it is."""
    folder = share_directory('example-robot-data') / 'robots'
    names = list(ROBOTS)[:QUICK_ROBOTS] if quick else list(ROBOTS)
    files = {name: folder / ROBOTS[name] for name in names}
    files |= {path: Path(path).absolute() for path in more}
    rows: dict[str, Row] = {}
    experiments: dict[str, Experiment] = {}
    for name, path in files.items():
        try:
            experiments[name] = walk(name, path, seeds(1 if quick else 3))
        except UserError as error:
            rows[name] = skipped(name, str(error))
    ups = [rise(name, files[name], seeds(2 if quick else 20)) for name in experiments]
    experiments |= {up.what: up for up in ups}
    runs = [run for experiment in experiments.values() for run in experiment.runs]
    results = simulate_all(runs, note)
    rows |= {name: experiment.row(results) for name, experiment in experiments.items()}
    return [rows[name] for name in [*files, *(up.what for up in ups)]]


def skipped(name: str, reason: str) -> Row:
    """Return the row of a robot that is not here; one that was asked for by name fails it."""
    asked = name not in ROBOTS
    return Row(what=what(name), measured=f'skipped: {reason}', must=MUST, passed=not asked)


def rise(name: str, path: Path, chosen: Sequence[int]) -> Experiment:
    """Return the experiment of one robot that lies anyhow and is to get up within a Go2's 16 s."""
    scale = scale_at(path)
    return get_up(
        *(f'{name}, any pose', 'flat', 0.0, chosen),
        description=str(path),
        scale=scale,
        patience=16.0,
        share=0.9,
    )


def what(name: str) -> str:
    """Return the heading of a robot's row."""
    return f'quadruped {name}: 10 s ahead, sideways, on the spot'


def scale_at(path: Path) -> Scale:
    """
    Return the size of a robot.

    Raises:
        UserError: its description is missing or no quadruped.
    """
    return scale_of(read_description(path).quadruped)


def walk(name: str, path: Path, chosen: Sequence[int]) -> Experiment:
    """
    Return the experiment of one robot.

    Raises:
        UserError: its description is missing or no quadruped.
    """
    if not path.is_file():
        raise UserError(f'{path.name} is not installed')
    scale = scale_at(path)
    script, spans = walk_script(scale)
    end = spans[-1][2]
    runs = [Run(seed=seed, twist=script, duration=end, description=str(path)) for seed in chosen]

    def say(trials: list[Trial]) -> str:
        up = format_count(sum(found['up'] for found in trials), len(trials))
        still = f'{worst(trials, "roll"):.1f} {worst(trials, "pitch"):.1f} deg'
        return f'{100 * worst(trials, "error"):.1f} % at worst, {still}, {up} up'

    return judged(what(name), MUST, runs, lambda trace: trial(trace, spans), say, share=None)


def walk_script(scale: Scale) -> tuple[str, list[Span]]:
    """Return a --twist script and when each leg of the walk counts."""
    lines, spans, time = [], [], START
    factors = np.array((scale.of('m/s'), scale.of('m/s'), scale.of('rad/s')))
    for velocity, seconds in LEGS_OF_THE_WALK:
        wanted = np.round(factors * velocity, 3)
        axis = int(np.argmax(wanted))
        lines.append(f'{time} {" ".join(map(str, wanted.tolist()))}\n')
        spans.append((axis, time + SETTLE, time + seconds, float(wanted[axis])))
        time += seconds
    return ''.join(lines), spans


def trial(trace: Trace, spans: Sequence[Span]) -> Trial:
    """Return one run as the JSON has it: the largest error as a share, standard deviations."""
    errors, names = [], ('vx', 'vy', 'wz')
    values: dict[str, float] = {}
    for axis, begin, end, wanted in spans:
        rows = (trace.t >= begin) & (trace.t < end)
        mean = float(trace.velocity[rows, axis].mean())
        errors.append(abs(mean / wanted - 1.0))
        values |= {names[axis]: mean, f'{names[axis]}_wanted': wanted}
    roll, pitch = np.degrees(trace.rpy[trace.after(spans[0][1]), :2].std(axis=0)).tolist()
    error = max(errors)
    passed = trace.is_up and error <= 0.1
    return {'passed': passed, 'error': error, 'roll': roll, 'pitch': pitch, **values}
