# SPDX-License-Identifier: Apache-2.0
"""What a recording says of its run, beside the topics, and the options that repeat it."""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
from typing import Any

from wasd_bringup.errors import RecordingError
from wasd_bringup.options import RunOptions
from wasd_bringup.scripts import parse_push
from wasd_bringup.scripts import push_text

# Name of the metadata record in the file.
RECORD_NAME = 'wasd'
# Topics that a replay has to find under their own names.
RENAMED = ('keys', 'cmd_vel', 'robot_description', 'ground_truth/odom')


def describe_run(options: RunOptions, ros_arguments: Sequence[str] = ()) -> dict[str, str]:
    """Return what has to be known to run the same commands again, as JSON by name."""
    controller = options.controller
    run: dict[str, Any] = {
        'robot': options.robot,
        'description': _absolute(options.description),
        'package_path': [str(path) for path in options.package_path],
        'world': _absolute(options.world),
        'seed': options.seed,
        'estimator': options.estimator,
        'limits': options.limits,
        'mode': options.mode,
        'controller': None if controller is None else str(controller.resolve()),
        'pushes': [push_text(push) for push in options.pushes],
        'ros_arguments': list(ros_arguments),
    }
    return {name: json.dumps(value) for name, value in run.items()}


def recorded_options(run: Mapping[str, str]) -> RunOptions:
    """
    Return the options of a recorded run, without its commands.

    Raises:
        RecordingError: it is of another version of this program.
    """
    try:
        known = {name: json.loads(value) for name, value in run.items()}
        controller = known['controller']
        return RunOptions(
            robot=known['robot'],
            description=known['description'],
            package_path=tuple(map(Path, known['package_path'])),
            world=known['world'],
            # The Go2's own keys; those that became velocities are recorded as such.
            preset='unitree' if known['robot'] == 'go2' else 'mbot',
            seed=known['seed'],
            estimator=known['estimator'],
            limits=known['limits'],
            mode=known['mode'],
            controller=None if controller is None else Path(controller),
            pushes=tuple(map(parse_push, known['pushes'])),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f'recorded by another version of wasd ({error!r})') from None


def recorded_ros_arguments(run: Mapping[str, str]) -> list[str]:
    """
    Return the ROS arguments of a recorded run.

    Raises:
        RecordingError: they give other names to topics, which then cannot be told apart.
    """
    arguments: list[str] = json.loads(run.get('ros_arguments', '[]'))
    for word in arguments:
        if ':=' in word and word.partition(':=')[0].rpartition(':')[2] in RENAMED:
            raise RecordingError(f'recorded with {word}: cannot be driven again')
    return arguments


def _absolute(name_or_path: str) -> str:
    return str(Path(name_or_path).resolve()) if Path(name_or_path).is_file() else name_or_path
