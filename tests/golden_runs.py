# SPDX-License-Identifier: Apache-2.0
"""
Runs whose every bit is known: what changes without being meant to shows here.

`python tests/golden_runs.py FILE` runs them all in one process and writes what came of each: a
hash of the report's samples, where it ended, and what was recorded. The file of the tests is
`tests/golden/runs.json`; write it again only after a change that is meant to change a walk, and
say which in the commit.
"""

import contextlib
import hashlib
import importlib
import io
import json
import os
from pathlib import Path
import shlex
import sys
import tempfile
from typing import Any

# It stands after a second, and then begins what was asked for meanwhile.
STAND = '0.02 2\n0.04 5'
FORWARD = '1.1 0.5 0 0\n1.8 0.4 0.2 0.5\n2.6 0 0 0'
SQUARE = '0.1 i*20\n0.9 j*12\n1.5 i*15'
TOUR = '0.02 2\n1.2 4\n1.3 w*6\n2.1 SPACE a*6\n2.9 SPACE j*5'
# From the walk through all other gaits, the trot the last but one, a second of each, and back.
GAITS = '2 n\n3 n\n4 n\n5 n\n6.2 n\n7 N'
# Name -> words after `wasd`, key script, velocities. `{}` is the folder of the run.
RUNS: dict[str, tuple[str, str, str]] = {
    'sticks': ('go2 --duration 3.2', TOUR, ''),
    'velocities': ('go2 --duration 2.9', STAND, FORWARD),
    'by truth': ('go2 --duration 2.2 --estimator truth', STAND, FORWARD),
    'race': ('go2 --duration 2.9 --limits race', STAND, '1.1 2.5 0 0\n2.6 0 0 3'),
    'guide': ('go2 --duration 2.4 --limits guide', TOUR, ''),
    'gaits': (
        'go2 --duration 7.3 --gait walk',
        f'{STAND}\n{GAITS}',
        '1.1 0.5 0 0\n1.6 0.4 0.2 0.5\n5 1.5 0 0\n6.2 0.5 0 0',
    ),
    'push': ('go2 --duration 2.3 --push "1.7 0 200 0 0.1"', STAND, FORWARD),
    'knocked over': ('go2 --duration 4 --push "1.2 0 400 0 0.2 0 0 0.3"', '0.02 2\n2.4 6', ''),
    'tests': ('go2 --duration 4.5', '0.02 2\n1.2 0\n1.4 w*5\n1.9 2\n2.2 9\n3.4 2\n3.6 8', ''),
    'jump and lie': ('go2 --duration 4.3', '0.02 2\n1.2 v\n2.8 7\n4.2 1', ''),
    'free stand': ('go2 --duration 1.9', '0.02 2\n1.2 3\n1.4 w*5 d*5 j*5', ''),
    'slope': ('go2 --duration 3.4 --world slope:15', STAND, '1.1 0.5 0 0'),
    'stairs': ('go2 --duration 4 --world stairs:0.1', STAND, '1.1 0.5 0 0'),
    'boxes': ('go2 --duration 4 --world boxes:0.05 --seed 3', STAND, '1.1 0.5 0 0'),
    'rough': ('go2 --duration 3.2 --world rough:0.05 --seed 4', STAND, '1.1 0.5 0 0'),
    'ice': ('go2 --duration 4 --world ice:0.2', STAND, '1.1 1 0 0'),
    'payload': ('go2 --duration 1.9 --payload 5 --friction 0.4', STAND, FORWARD),
    'differs': ('go2 --duration 1.9 --randomise 1 --seed 7', STAND, FORWARD),
    'preset go2': ('go2 --duration 1.9 --preset go2', f'{STAND}\n1.1 w*30', ''),
    'square': ('mbot --duration 1.9', SQUARE, ''),
    'fake': ('mbot --duration 1.9 --mode fake', SQUARE, ''),
    'arbotix': ('mbot --duration 1.9 --mode arbotix', SQUARE, ''),
    'ramps': ('mbot --duration 2 --preset ramps', '0.1 w*20\n1 a*15', ''),
    'wheels by velocity': ('mbot --duration 2', '', '0.1 0.3 0 0.5\n0.8 0 0 1\n1.2 stop'),
    'map and goal': ('mbot --duration 2.4 --world flat:3 --map --goal "0.3 0.1"', '', ''),
    'both': ('both --duration 2.4', '0.02 2\n1.2 4\n1.3 w*4\n1.9 TAB i*20', ''),
}
RECORDED = ('velocities', 'square', 'both')
# Topics that say nothing of wall time: their messages are compared, too.
UNTIMED = ('/odom', '/cmd_vel', '/joint_states', '/keys', '/tf', '/clock', '/imu/data')
# A walk that differs in its last bits only ends this near [m]; ends are written to a millimetre.
NEAR = 0.005


def arithmetic() -> str:
    """Return a hash of what this machine computes: only an equal one gives equal bits."""
    import numpy as np

    matrix = np.random.default_rng(0).normal(size=(48, 48))
    numbers = [
        matrix @ matrix,
        np.linalg.solve(matrix, matrix[0]),
        np.sin(matrix) * np.exp(matrix),
    ]
    return hashlib.sha256(b''.join(each.tobytes() for each in numbers)).hexdigest()[:16]


def run_all(folder: Path) -> dict[str, Any]:
    """Run everything in a folder; return what came of it."""
    return {'arithmetic': arithmetic(), 'runs': {name: run(name, folder) for name in RUNS}}


def run(name: str, folder: Path) -> dict[str, Any]:
    """Run one; return its samples' hash, its robots' ends, and what was recorded."""
    from wasd_bringup.cli import main

    words, keys, velocities = RUNS[name]
    report, bag = folder / f'{name}.json', folder / f'{name}.mcap'
    arguments = [*shlex.split(words), '--speed', '0', '--report', str(report)]
    for option, text in (('--play', keys), ('--twist', velocities)):
        if text:
            script = folder / f'{name}{option}'
            script.write_text(text)
            arguments += [option, str(script)]
    if name in RECORDED:
        arguments += ['--record', str(bag)]
    with contextlib.redirect_stdout(io.StringIO()):
        status = main(arguments)
    if status != 0:
        raise SystemExit(f'{name}: ended with status {status}')
    found = {'samples': '', **_outcome(json.loads(report.read_text()))}
    if name in RECORDED:
        found['topics'] = _recorded(bag)
    return found


def _outcome(report: dict[str, Any]) -> dict[str, Any]:
    robots = report.get('robots', {report['robot']: report})
    samples = {robot: one['samples'] for robot, one in robots.items()}
    return {
        'samples': _hash(samples),
        'ends': {
            robot: [round(x, 3) for x in one['position'][-1]] for robot, one in samples.items()
        },
        'states': {robot: list(dict.fromkeys(one['state'])) for robot, one in samples.items()},
        'falls': [one['falls'] for one in robots.values()],
    }


def _recorded(path: Path) -> dict[str, list[Any]]:
    """Return of each topic its type, its count and a hash of its decoded messages."""
    from rclpy.serialization import deserialize_message
    from wasd_bringup.tools.recording.reader import BagReader

    reader = BagReader(path)
    found: dict[str, list[Any]] = {}
    kinds, said = {}, {}
    for topic in reader.topics:
        if topic.name.endswith('/diagnostics'):
            continue  # by wall time: a run of less than a second has none
        found[topic.name] = [topic.kind, topic.messages]
        if topic.name.endswith(UNTIMED):
            package, _, name = topic.kind.split('/')
            kinds[topic.name] = getattr(importlib.import_module(f'{package}.msg'), name)
            said[topic.name] = []
    for message in reader.messages(kinds):
        fields = _fields(deserialize_message(message.data, kinds[message.topic]))
        said[message.topic].append(fields)
    for name, messages in said.items():
        found[name].append(_hash(messages))
    return found


def _fields(value: Any) -> Any:
    """Return what a message says, as lists; `repr` of an odometry takes five times as long."""
    if isinstance(value, (str, bool, int, float)):
        return value
    if hasattr(value, 'tolist'):
        return value.tolist()
    if hasattr(value, 'get_fields_and_field_types'):
        return [_fields(getattr(value, name)) for name in value.get_fields_and_field_types()]
    return [_fields(each) for each in value]


def _hash(value: Any) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:16]


if __name__ == '__main__':
    import expansions
    import robot_description.description  # noqa: F401

    expansions.remember()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    with tempfile.TemporaryDirectory() as scratch:
        outcome = run_all(Path(scratch))
    Path(sys.argv[1]).write_text(json.dumps(outcome, indent=1) + '\n')
