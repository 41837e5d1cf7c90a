# SPDX-License-Identifier: Apache-2.0
"""`wasd replay`: shows a recording, or drives its commands again and compares the paths."""

import argparse
from collections.abc import Callable, Mapping, Sequence
import contextlib
import dataclasses
import math
import os
from pathlib import Path
import sys
import time
from typing import Any

from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.viewer.drawing import Panel
from mujoco_sim.viewer.views import start_view
from mujoco_sim.world import pose_base, pose_joints, update_bodies, World
from nav_msgs.msg import Odometry
import rclpy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from wasd_core.network import set_range
from wasd_core.node import init_ros
from wasd_core.signals import StopSignals
from wasd_core.streams import say_vain

from wasd_bringup.cli.options import read_number
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.ros.home import with_own_frames
from wasd_bringup.run.inputs import BoxPlayer, ScriptedBox
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.worlds import build_worlds
from wasd_bringup.tools.recording.reader import (
    BagReader,
    DESCRIPTION,
    read_commands,
    recorded_options,
    recorded_ros_arguments,
    RecordedMessage,
    RecordingError,
    robot_topics,
    TRUTH,
)
from wasd_bringup.tools.recording.recorder import EVENTS, PublisherTap

LONGEST_GAP = 3_600_000_000_000  # of a recording's poses [ns]


class PathComparison:
    """
    Compares each true pose that this process publishes with the recorded one.

    They are the same when their numbers are: place, orientation, velocities and stamp.
    """

    def __init__(self, bag: BagReader, topics: Mapping[str, str]) -> None:
        """
        Read the recorded poses of all robots and begin to listen; `topics` by namespace.

        Raises:
            RecordingError: there are none, or a time without any is too long.
        """
        self._bag = bag
        self._recorded: dict[str, list[RecordedMessage]] = {topic: [] for topic in topics.values()}
        last = bag.start
        for message in bag.messages(topics.values()):
            if message.time - last > LONGEST_GAP:
                gap = f'no pose from {1e-9 * last:.0f} s to {1e-9 * message.time:.0f} s'
                raise RecordingError(f'{bag.path}: damaged: {gap}')
            last = message.time
            self._recorded[message.topic].append(message)
        self.count = sum(map(len, self._recorded.values()))
        if not self.count:
            raise RecordingError(f'{bag.path}: no ground_truth/odom in it')
        self._next = dict.fromkeys(self._recorded, 0)
        self._same = 0
        self._differs_from: float | None = None
        self._farthest = 0.0
        self._tap = PublisherTap(self._hear)

    @property
    def duration(self) -> float:
        """How long the run has to be for all of them to be published [s]."""
        last = max(messages[-1].time for messages in self._recorded.values() if messages)
        # Up to, but not including, the instant after the last.
        return 1e-9 * last + 0.001

    @property
    def is_same(self) -> bool:
        """Whether every recorded pose came again."""
        return self._same == self.count

    def verdict(self) -> str:
        """Return what came out of it, in one line."""
        text = f'{self._same} of {self.count} recorded poses are identical'
        if self._differs_from is None:
            return text
        return (
            f'{text}; the path differs from {self._differs_from:.2f} s on, '
            f'by up to {self._farthest:.4f} m'
        )

    def close(self) -> None:
        """Stop listening."""
        self._tap.remove()

    def _hear(self, topic: str, kind: str, profile: Any, data: bytes) -> None:
        recorded, index = self._recorded.get(topic, ()), self._next.get(topic, 0)
        if index >= len(recorded):
            return
        self._next[topic] += 1
        now = deserialize_message(data, Odometry)
        then = self._bag.read(recorded[index], Odometry)
        if now == then:
            self._same += 1
            return
        if self._differs_from is None:
            self._differs_from = 1e-9 * recorded[index].time
        self._farthest = max(self._farthest, math.dist(_place(now), _place(then)))


def _place(pose: Odometry) -> tuple[float, float, float]:
    place = pose.pose.pose.position
    return place.x, place.y, place.z


JOINTS = 'joint_states'
CAMERA = CameraView(distance=2.0, azimuth=130.0, elevation=-20.0)


def _worlds_of(topics: Mapping[str, str], worlds: Mapping[str, World]) -> dict[str, World]:
    """Return the world of each topic, of those of robots that there are."""
    return {topic: worlds[name] for name, topic in topics.items() if name in worlds}


class ReplayView:
    """Moves the robots of some worlds as recorded, at a speed; 0 is as fast as possible."""

    def __init__(
        self,
        bag: BagReader,
        worlds: Sequence[World],
        speed: float,
        boxes: Sequence[ScriptedBox] = (),
    ) -> None:
        self._bag = bag
        self._speed = speed
        self._world = worlds[0]
        self._boxes = BoxPlayer(boxes, self._world.physics.boxes.put)
        by_name = {world.prefix.rstrip('/'): world for world in worlds}
        self._truths = _worlds_of(robot_topics(bag, TRUTH), by_name)
        self._joints = _worlds_of(robot_topics(bag, JOINTS), by_name)
        self._shown = bag.start

    def open(self, kind: str, port: int) -> str:
        """
        Start a viewer; return where it is.

        Raises:
            SimulationError: the port is taken, or there is no display.
        """
        panel = Panel(self._status, ['Ctrl-C in the terminal quits.'])
        self._view, where = start_view(kind, self._world, CAMERA, panel, port)
        return where

    def run(self, stop: Callable[[], bool]) -> None:
        """Show it all, then the last picture until `stop`."""
        started = time.monotonic()
        drawn = 0.0
        for message in self._bag.messages([*self._truths, *self._joints, EVENTS]):
            if message.time > self._shown:
                self._shown = message.time
                due = self._due(started)
                while not stop() and time.monotonic() < due:
                    time.sleep(min(self._view.period, max(0.0, due - time.monotonic())))
                if time.monotonic() - drawn >= self._view.period:
                    drawn = time.monotonic()
                    self._draw()
            if stop():
                return
            self._boxes.step(1e-9 * message.time)
            self._apply(message)
        while not stop():
            self._draw()
            time.sleep(self._view.period)

    def close(self) -> None:
        """Close the viewer."""
        self._view.close()

    def _apply(self, message: RecordedMessage) -> None:
        if message.topic in self._truths:
            pose = self._bag.read(message, Odometry).pose.pose
            place, turn = pose.position, pose.orientation
            position, orientation = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
            pose_base(self._truths[message.topic], position, orientation)
        elif message.topic == EVENTS:
            if self._bag.read(message, String).data == 'reset':
                self._world.reset()  # which removes the boxes
        else:
            joints = self._bag.read(message, JointState)
            if len(joints.name) != len(joints.position):
                at = f'{message.topic} at {1e-9 * message.time:.2f} s'
                got = f'got {len(joints.position)} positions of {len(joints.name)} joints'
                raise RecordingError(f'{self._bag.path}: damaged: {at}: {got}')
            pose_joints(self._joints[message.topic], joints.name, joints.position)

    def _draw(self) -> None:
        update_bodies(self._world)
        self._view.sync()

    def _due(self, started: float) -> float:
        """Return the wall time [s] at which to show the present message."""
        if self._speed == 0.0:
            return started
        return started + 1e-9 * (self._shown - self._bag.start) / self._speed

    def _status(self) -> list[str]:
        now, end = 1e-9 * self._shown, 1e-9 * self._bag.end
        return [f'{self._bag.path.name}  {now:.1f} of {end:.1f} s']


def replay_command(arguments: argparse.Namespace) -> int:
    """
    Show or drive a recording as the options say; return the exit status.

    That is 1 where the path driven again is another one.

    Raises:
        UserError: what is wrong with the recording or the options.
    """
    bag = BagReader(Path(arguments.file))
    if bag.breaks_off:
        print(f'WARNING: {bag.path}: breaks off after {1e-9 * bag.end:.2f} s', file=sys.stderr)
    try:
        options = recorded_options(bag.run)
        # Says now what cannot be repeated.
        ros_arguments = recorded_ros_arguments(bag.run) if arguments.drive else []
    except RecordingError as error:
        raise RecordingError(f'{bag.path}: {error}') from None
    options = dataclasses.replace(options, urdfs=_descriptions(bag), port=arguments.port)
    viewer = arguments.viewer or ('web' if sys.stdout.isatty() else 'none')
    usual = '0' if viewer == 'none' else '1'
    speed = read_number(arguments.speed or usual, '--speed')
    if viewer == 'none':
        given = {'--port': arguments.port, '--speed': not arguments.drive and arguments.speed}
        say_vain([word for word, value in given.items() if value])
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
    view = ReplayView(bag, worlds, speed, options.boxes)
    where = view.open(viewer, options.port)
    with contextlib.closing(view):
        print(f'viewer: {where}', flush=True)
        view.run(lambda: stop.requested)
    return stop.exit_status


def _drive(
    bag: BagReader, options: RunOptions, ros_arguments: list[str], viewer: str, stop: StopSignals
) -> int:
    """Run the simulation with the recorded commands, by itself, and compare the paths."""
    set_range(os.environ, 'off')
    comparison = PathComparison(bag, robot_topics(bag, TRUTH))
    options = dataclasses.replace(options, duration=comparison.duration)
    init_ros(with_own_frames(ros_arguments))
    run = None
    try:
        run = make_ros_run(options, visuals=viewer != 'none')
        if viewer != 'none':
            # Here, because only a viewer needs it.
            from wasd_bringup.page.bridge import open_view

            print(f'viewer: {open_view(run, viewer)}', flush=True)
        run.run(stop)
    finally:
        comparison.close()
        if run is not None:
            run.close()
        rclpy.try_shutdown()
    print(comparison.verdict())
    return stop.exit_status or int(not comparison.is_same)


def _descriptions(bag: BagReader) -> dict[str, str]:
    """Return the URDF of each robot by its namespace; refuse a recording without any."""
    found = {}
    topics = robot_topics(bag, DESCRIPTION)
    for message in bag.messages(topics.values()):
        (namespace,) = (name for name, topic in topics.items() if topic == message.topic)
        found[namespace] = bag.read(message, String).data
    if not found:
        raise RecordingError(f'{bag.path}: no {DESCRIPTION} in it')
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
