# SPDX-License-Identifier: Apache-2.0
"""`wasd replay`: shows a recording, or drives its commands again."""

import argparse
import contextlib
import dataclasses
from pathlib import Path
import sys

import rclpy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from wasd_core.node import init_ros
from wasd_core.signals import StopSignals

from wasd_bringup.bag_reader import BagReader
from wasd_bringup.discovery_range import keep_alone
from wasd_bringup.driven_robot import build_worlds
from wasd_bringup.errors import RecordingError
from wasd_bringup.options import read_number
from wasd_bringup.options import RunOptions
from wasd_bringup.recorded_commands import DESCRIPTION
from wasd_bringup.recorded_commands import read_commands
from wasd_bringup.recorded_commands import robot_topics
from wasd_bringup.recorded_commands import TRUTH
from wasd_bringup.recorded_path import PathComparison
from wasd_bringup.recorded_run import recorded_options
from wasd_bringup.recorded_run import recorded_ros_arguments
from wasd_bringup.replay_view import ReplayView
from wasd_bringup.run_place import with_own_frames
from wasd_bringup.session import Session


def replay_command(arguments: argparse.Namespace) -> int:
    """
    Show or drive a recording as the options say; return the exit status.

    That is 1 where the path driven again is another one.

    Raises:
        UserError: what is wrong with the recording or the options.
    """
    bag = BagReader(Path(arguments.file))
    try:
        options = recorded_options(bag.run)
        # Says now what cannot be repeated.
        ros_arguments = recorded_ros_arguments(bag.run) if arguments.drive else []
        options = dataclasses.replace(options, urdfs=_descriptions(bag), port=arguments.port)
    except RecordingError as error:
        raise RecordingError(f'{bag.path}: {error}') from None
    viewer = arguments.viewer or ('web' if sys.stdout.isatty() else 'none')
    usual = '0' if viewer == 'none' else '1'
    speed = read_number(arguments.speed or usual, '--speed')
    with StopSignals() as stop:
        if arguments.drive:
            options = dataclasses.replace(options, speed=speed, commands=read_commands(bag))
            return _drive(bag, options, ros_arguments, viewer, stop)
        if viewer == 'none':
            print('\n'.join(_summary(bag)))
            return 0
        return _show(bag, options, viewer, speed, stop)


def _show(
    bag: BagReader, options: RunOptions, viewer: str, speed: float, stop: StopSignals
) -> int:
    worlds = [world for _, _, world in build_worlds(options, visuals=True)]
    view = ReplayView(bag, worlds, speed)
    with contextlib.closing(view):
        print(f'viewer: {view.open(viewer, options.port)}', flush=True)
        view.run(lambda: stop.requested)
    return stop.exit_status


def _drive(
    bag: BagReader, options: RunOptions, ros_arguments: list[str], viewer: str, stop: StopSignals
) -> int:
    """Run the simulation with the recorded commands, by itself, and compare the paths."""
    keep_alone()
    comparison = PathComparison(bag, robot_topics(bag, TRUTH))
    options = dataclasses.replace(options, duration=comparison.duration)
    init_ros(with_own_frames(ros_arguments))
    session = None
    try:
        session = Session(options, visuals=viewer != 'none')
        if viewer != 'none':
            print(f'viewer: {session.open_view(viewer)}', flush=True)
        session.run(stop)
    finally:
        comparison.close()
        if session is not None:
            session.close()
        rclpy.try_shutdown()
    print(comparison.verdict())
    return stop.exit_status or int(not comparison.is_same)


def _descriptions(bag: BagReader) -> dict[str, str]:
    """
    Return the URDF of each robot by its namespace.

    Raises:
        RecordingError: there is none.
    """
    found = {}
    topics = robot_topics(bag, DESCRIPTION)
    for message in bag.messages(topics.values()):
        (namespace,) = (name for name, topic in topics.items() if topic == message.topic)
        found[namespace] = deserialize_message(message.data, String).data
    if not found:
        raise RecordingError(f'no {DESCRIPTION} in it')
    return found


def _summary(bag: BagReader) -> list[str]:
    """Return what is in a recording, in the words of `ros2 bag info`."""
    seconds = 1e-9 * (bag.end - bag.start)
    size = bag.path.stat().st_size
    lines = [
        f'Files:             {bag.path}',
        f'Bag size:          {size / 2**20:.1f} MiB',
        'Storage id:        mcap',
        f'Duration:          {seconds:.3f}s',
        f'Messages:          {sum(topic.messages for topic in bag.topics)}',
        f'Run:               {", ".join(f"{name} {value}" for name, value in bag.run.items())}',
        'Topic information:',
    ]
    for topic in bag.topics:
        lines.append(f'  Topic: {topic.name} | Type: {topic.kind} | Count: {topic.messages}')
    return lines
