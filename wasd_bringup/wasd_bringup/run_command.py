# SPDX-License-Identifier: Apache-2.0
"""`wasd mbot`: one robot, driven from the terminal, the page, a pipe or a script."""

import argparse
from collections.abc import Sequence
import contextlib
import dataclasses
import math
import sys

import rclpy
from robot_description.node_support import init_ros
from robot_description.node_support import StopSignals
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.key_reader import open_key_reader
from teleop_keyboard.terminal import NoTerminal

from wasd_bringup.bag_recorder import BagRecorder
from wasd_bringup.discovery_range import choose_range
from wasd_bringup.errors import UsageError
from wasd_bringup.options import read_options
from wasd_bringup.options import RunOptions
from wasd_bringup.recorded_run import describe_run
from wasd_bringup.run_place import own_place
from wasd_bringup.run_place import with_own_frames
from wasd_bringup.session import Session


def run_command(arguments: argparse.Namespace, ros_arguments: Sequence[str] = ()) -> int:
    """
    Run a robot as the options say; return the exit status. `ros_arguments` begin with --ros-args.

    Raises:
        UserError: what is wrong with the options or the files they name.
    """
    options = read_options(arguments)
    reader = _open_keys(options)
    viewer = options.viewer or ('web' if _is_interactive(reader) else 'none')
    if reader is None and viewer == 'none' and options.duration == math.inf:
        raise UsageError(
            'no terminal for the keys: give --play FILE, --twist FILE, --duration S, '
            '--viewer web, or pipe keys into standard input'
        )
    choose_range(options.discovery, options.scripted and options.speed == 0.0)
    place = own_place(options, ros_arguments)
    with place, StopSignals() as stop, reader or contextlib.nullcontext():
        init_ros(with_own_frames(ros_arguments), is_local=True)
        session = recorder = None
        try:
            options = dataclasses.replace(options, interactive=_is_interactive(reader))
            if options.record is not None:
                recorder = BagRecorder(options.record, describe_run(options, ros_arguments))
            session = Session(options, reader, viewer != 'none', recorder)
            session.open_view(viewer)
            if _is_interactive(reader) or viewer != 'none':
                print('\n'.join(session.first_lines), flush=True)
            session.run(stop)
        finally:
            with contextlib.ExitStack() as last:
                last.callback(rclpy.try_shutdown)
                if recorder is not None:
                    last.callback(recorder.close)
                if session is not None:
                    session.close()
    with contextlib.suppress(OSError):  # the terminal may have gone
        print(_summary(session, options), flush=True)
    return stop.exit_status


def _open_keys(options: RunOptions) -> KeyReader | None:
    """Return where keys come from; None when scripts drive or when there is nothing to read."""
    if options.scripted:
        return None
    try:
        return open_key_reader()
    except NoTerminal:
        return None


def _is_interactive(reader: KeyReader | None) -> bool:
    return reader is not None and reader.terminal is not None and sys.stdout.isatty()


def _summary(session: Session, options: RunOptions) -> str:
    report = session.report()
    places = []
    for robot in session.robots:
        x, y, _ = robot.world.base().position
        places.append(f'{robot.name} at {x:.3f} {y:.3f} m')
    text = (
        f'{report["sim_time"]:.1f} s simulated in {report["wall_time"]:.1f} s '
        f'(x{report["real_time_factor"]:.1f}); {", ".join(places)}'
    )
    written = {'recorded to': options.record, 'report in': options.report}
    return '; '.join([text, *(f'{what} {path}' for what, path in written.items() if path)])
