# SPDX-License-Identifier: Apache-2.0
"""`wasd go2` and the like: robots, driven from the terminal, the page, a pipe or a script."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
import dataclasses
import functools
import importlib.util
import logging
import math
import os
import shutil
import subprocess
import sys
from typing import Any, TextIO

from teleop_keyboard.key_reader import KeyReader, open_key_reader
from teleop_keyboard.screen import folded
from teleop_keyboard.terminal import NoTerminal
from wasd_core.errors import attempt_all, Stopped, UserError
from wasd_core.signals import last_status, leave, StopSignals
from wasd_core.streams import never_wait, say_vain

from wasd_bringup.cli.options import read_options, vain_words
from wasd_bringup.page.restart import become
from wasd_bringup.run.options import choose_range, RunOptions
from wasd_bringup.run.run import Run

# Options that only ROS serves.
NEED_ROS = ('record', 'foxglove', 'gamepad', 'discovery')


def run_command(
    arguments: argparse.Namespace,
    ros_arguments: Sequence[str],
    end_loading: Callable[[], None],
) -> int:
    """
    Run a robot as the options say; return the exit status. `ros_arguments` begin with --ros-args.

    It calls `end_loading` once everything is loaded and the robots are about to run.

    Raises:
        UserError: what is wrong with the options or the files they name.
    """
    never_wait()
    environment = dict(os.environ)
    options = read_options(arguments)
    reader = None  # where scripts drive, or there is nothing to read
    if not options.scripted:
        with contextlib.suppress(NoTerminal):
            reader = open_key_reader()
    viewer = options.viewer or ('web' if _is_interactive(reader) else 'none')
    is_deaf = reader is None and viewer == 'none' and not options.has_guests
    if is_deaf and options.duration == math.inf:
        raise UserError(
            'no terminal for the keys: give --play FILE, --twist FILE, --duration S, '
            '--viewer web, --gamepad, --foxglove, or pipe keys into standard input'
        )
    uses_ros = _uses_ros(options, ros_arguments)
    choose_range(options.discovery, options.scripted and options.speed == 0.0)
    place: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
    make_run: Callable[..., Run] = _make_plain_run
    if uses_ros:
        # Here, because a run without ROS does not load it.
        from wasd_bringup.ros.home import make_public_run, own_place

        place = own_place(options, ros_arguments)
        make_run = functools.partial(make_public_run, ros_arguments)
    made: list[Run] = []
    # What ends everything, also what has begun in part, in this order.
    ends: list[Callable[[], object]] = []

    def do() -> None:
        run = make_run(options, reader, viewer != 'none', ends)
        made.append(run)
        say_vain(vain_words(arguments, {'page': viewer == 'web', **run.has}))
        # Robots stop when the process is suspended, or ended in the midst of something.
        stop.last_words.insert(0, run.stop)
        if reader is not None and reader.terminal is not None:
            reader.terminal.before_suspend.append(run.stop)
            reader.terminal.after_resume.append(run.resume)
        if viewer != 'none':
            # Here, because only a viewer needs it.
            from wasd_bringup.page.bridge import open_view

            where = open_view(run, viewer)
            if viewer == 'web' and options.interactive and options.opens_page:
                show_page(where)
        if options.interactive or viewer != 'none' or options.has_guests:
            out = _where_to_say(options)
            print(folded(run.first_lines, out), file=out, flush=True)
        end_loading()
        run.run(stop)

    with (
        place,
        StopSignals() as stop,
        reader or contextlib.nullcontext(),
    ):
        if reader is not None and reader.terminal is not None:
            stop.last_words.append(reader.terminal.restore)
        options = dataclasses.replace(
            options,
            interactive=_is_interactive(reader),
            words=getattr(arguments, 'words', ()),
        )
        try:
            attempt_all(do, lambda: attempt_all(*ends))
        except Stopped:
            return stop.exit_status
    (run,) = made
    print(_summary(run, options), file=_where_to_say(options))
    if run.next_words:
        become(run.next_words, environment)
    status = last_status(stop)
    if stop.number is not None:
        leave(status)
    return status


def _make_plain_run(
    options: RunOptions, reader: KeyReader | None, visuals: bool, ends: list[Callable[[], object]]
) -> Run:
    """Return a run that no other process sees; what is odd about its robots is on stderr."""
    log = logging.getLogger('wasd')
    log.addHandler(logging.StreamHandler())
    log.setLevel(logging.INFO)
    run = Run(options, reader, visuals)
    ends.append(run.close)
    for robot in run.robots:
        tell = functools.partial(robot.log.warning, '%s: %s', robot.name)
        for note in robot.notes:
            tell(note)
        if legs := getattr(robot, 'legs', None):
            legs.on_said = tell
    if options.interactive:
        # What is said while it runs is in the status line; a log would break that line.
        log.setLevel(logging.ERROR)
    return run


def _uses_ros(options: RunOptions, ros_arguments: Sequence[str]) -> bool:
    """Return whether a run uses ROS; refuse options that need it if it does not."""
    is_there = importlib.util.find_spec('rclpy') is not None
    if is_there and options.uses_ros:
        return True
    why = 'rclpy is not installed' if options.uses_ros else '--no-ros'
    asked = [f'--{name}' for name in NEED_ROS if getattr(options, name) is not None]
    asked += ['--ros-args'] * bool(ros_arguments)
    if asked:
        raise UserError(f'{asked[0]} needs ROS, but this run has none ({why})')
    if options.uses_ros:
        print('wasd: runs without ROS (rclpy is not installed)', file=sys.stderr, flush=True)
    return False


def show_page(url: str, environment: Mapping[str, str] = os.environ) -> bool:
    """
    Open a page in the desktop's browser; return False if there is no desktop.

    A display forwarded over SSH does not count: its machine cannot reach the page.
    """
    opener = shutil.which('xdg-open', path=environment.get('PATH'))
    has_display = environment.get('DISPLAY') or environment.get('WAYLAND_DISPLAY')
    if not opener or not has_display or environment.get('SSH_CONNECTION'):
        return False
    # Its own session and no terminal: Ctrl-C is for us, and its words are not the driver's.
    subprocess.Popen(
        [opener, url],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=dict(environment),
    )
    return True


def _where_to_say(options: RunOptions) -> TextIO:
    """Return where words go: not between the data of an output that is sent to standard output."""
    return sys.stderr if options.prints_data else sys.stdout


def _is_interactive(reader: KeyReader | None) -> bool:
    return reader is not None and reader.terminal is not None and sys.stdout.isatty()


def _summary(run: Run, options: RunOptions) -> str:
    report = run.report()
    places = []
    for robot in run.robots:
        x, y, _ = robot.world.base().position
        places.append(f'{robot.name} at {x:z.3f} {y:z.3f} m')
    text = (
        f'{report["sim_time"]:.1f} s simulated in {report["wall_time"]:.1f} s '
        f'(x{report["real_time_factor"]:.1f}); {", ".join(places)}'
    )
    saved = options.save_map and f'{options.save_map}.yaml'
    written = {'recorded to': options.record, 'report in': options.report, 'map in': saved}
    text = '; '.join([text, *(f'{what} {path}' for what, path in written.items() if path)])
    return '\n'.join((text, *_missed_goals(report)))


def _missed_goals(report: dict[str, Any]) -> Iterator[str]:
    """Yield a line of each goal that a robot has not reached; of a patrol with the last reason."""
    for robot in report.get('robots', {'': report}).values():
        lines = dict[str, list[str]]()
        for goal in robot.get('navigation', {}).get('goals', ()):
            if goal['state'] in ('refused', 'failed'):
                x, y, _ = goal['goal']  # it may be none at all
                where = '' if x is None else f' {round(x, 2):zg} {round(y, 2):zg}'
                lines.setdefault(f'goal{where} {goal["state"]}', []).append(goal['reason'])
        for line, reasons in lines.items():
            times = f' ({len(reasons)} times)' if len(reasons) > 1 else ''
            yield f'{line}: {reasons[-1]}{times}'
