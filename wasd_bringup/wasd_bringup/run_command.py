# SPDX-License-Identifier: Apache-2.0
"""`wasd go2` and the like: robots, driven from the terminal, the page, a pipe or a script."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
import contextlib
import dataclasses
import math
import os
import shutil
import subprocess
import sys
from typing import TextIO, TYPE_CHECKING

import rclpy
from teleop_keyboard.key_reader import KeyReader, open_key_reader
from teleop_keyboard.terminal import NoTerminal
from wasd_core.errors import attempt_all, Stopped, UserError
from wasd_core.network import claim_domain, namespaces_of, RANGE
from wasd_core.node import init_ros
from wasd_core.signals import last_status, StopSignals
from wasd_core.streams import never_wait

from wasd_bringup.anew import become
from wasd_bringup.options import choose_range, NAMESPACED, read_options, RunOptions
from wasd_bringup.robots import BOTH
from wasd_bringup.session import Session

if TYPE_CHECKING:
    from wasd_bringup.recording.recorder import BagRecorder
    from wasd_bringup.session_foxglove import FoxgloveServer


def run_command(arguments: argparse.Namespace, ros_arguments: Sequence[str] = ()) -> int:
    """
    Run a robot as the options say; return the exit status. `ros_arguments` begin with --ros-args.

    Raises:
        UserError: what is wrong with the options or the files they name.
    """
    never_wait()
    environment = dict(os.environ)
    options = read_options(arguments)
    reader = _open_keys(options)
    viewer = options.viewer or ('web' if _is_interactive(reader) else 'none')
    is_deaf = reader is None and viewer == 'none' and not options.has_guests
    if is_deaf and options.duration == math.inf:
        raise UserError(
            'no terminal for the keys: give --play FILE, --twist FILE, --duration S, '
            '--viewer web, --gamepad, --foxglove, or pipe keys into standard input'
        )
    choose_range(options.discovery, options.scripted and options.speed == 0.0)
    place = own_place(options, ros_arguments)
    with place, StopSignals() as stop, reader or contextlib.nullcontext():
        init_ros(with_own_frames(ros_arguments), is_local=True)
        if reader is not None and reader.terminal is not None:
            stop.last_words.append(reader.terminal.restore)
        options = dataclasses.replace(
            options,
            interactive=_is_interactive(reader),
            words=getattr(arguments, 'words', ()),
        )
        run = _Run(options)
        try:
            attempt_all(
                lambda: run.do(reader, viewer, ros_arguments, stop), run.close, rclpy.try_shutdown
            )
        except Stopped:
            return stop.exit_status
    print(run.summary(), file=_where_to_say(options))
    if run.next_words:
        become(run.next_words, environment)
    return last_status(stop)


def _halt_with(stop: StopSignals, reader: KeyReader | None, session: Session) -> None:
    """Have the robots stand when the process is suspended, or ended in the midst of something."""
    stop.last_words.insert(0, session.stop)
    if reader is not None and reader.terminal is not None:
        reader.terminal.before_suspend.append(session.stop)
        reader.terminal.after_resume.append(session.resume)


class _Run:
    """A session and its recording, from their making to their end."""

    def __init__(self, options: RunOptions) -> None:
        self._options = options
        self._session: Session | None = None
        self._recorder: BagRecorder | None = None
        self._foxglove: FoxgloveServer | None = None

    def do(
        self,
        reader: KeyReader | None,
        viewer: str,
        ros_arguments: Sequence[str],
        stop: StopSignals,
    ) -> None:
        """Make everything, and run until the end."""
        options = self._options
        if options.record is not None:
            from wasd_bringup.recording.reader import describe_run
            from wasd_bringup.recording.recorder import BagRecorder

            self._recorder = BagRecorder(options.record, describe_run(options, ros_arguments))
        if options.foxglove is not None:
            from wasd_bringup.session_foxglove import FoxgloveServer

            self._foxglove = FoxgloveServer(options.foxglove)
        self._session = Session(options, reader, viewer != 'none', self._recorder, self._foxglove)
        _halt_with(stop, reader, self._session)
        if viewer != 'none':
            # Here, because only a viewer needs it.
            from wasd_bringup.cockpit.bridge import open_view

            where = open_view(self._session, viewer)
            if viewer == 'web' and options.interactive and options.opens_page:
                show_page(where)
        if options.interactive or viewer != 'none' or options.has_guests:
            words = '\n'.join(self._session.first_lines)
            print(words, file=_where_to_say(options), flush=True)
        self._session.run(stop)

    def close(self) -> None:
        """End everything, also what has begun in part; what fails hinders nothing else."""
        session, recorder = self._session, self._recorder
        served = [self._foxglove.close] if self._foxglove is not None else []
        if session is None:
            # Nothing has run: an older recording stays.
            attempt_all(*served, *([recorder.discard] if recorder is not None else []))
            return
        attempt_all(session.close, *served, *([recorder.close] if recorder is not None else []))

    @property
    def next_words(self) -> tuple[str, ...]:
        """The words of the run that is to come in its place, if one is."""
        return () if self._session is None else self._session.next_words

    def summary(self) -> str:
        """Return what has happened, in a line."""
        assert self._session is not None
        return _summary(self._session, self._options)


def show_page(url: str, environment: Mapping[str, str] = os.environ) -> bool:
    """
    Have the desktop open a page in its browser; return whether there is a desktop to ask.

    A display that is forwarded over SSH is none: the page is not on the machine that shows it.
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
        places.append(f'{robot.name} at {x:z.3f} {y:z.3f} m')
    text = (
        f'{report["sim_time"]:.1f} s simulated in {report["wall_time"]:.1f} s '
        f'(x{report["real_time_factor"]:.1f}); {", ".join(places)}'
    )
    saved = options.save_map and f'{options.save_map}.yaml'
    written = {'recorded to': options.record, 'report in': options.report, 'map in': saved}
    return '; '.join([text, *(f'{what} {path}' for what, path in written.items() if path)])


@contextlib.contextmanager
def own_place(options: RunOptions, ros_arguments: Sequence[str]) -> Iterator[None]:
    """
    Context of a run that others may talk to; it changes ROS_DOMAIN_ID where that is unset.

    Says in one line on standard error when the run is not where one would look for it.
    """
    if os.environ.get(RANGE) == 'OFF':  # nobody hears it, wherever it is
        yield
        return
    namespaces = namespaces_of(ros_arguments)
    if options.robot == BOTH:  # /clock and /tf are those of the root
        namespaces += [f'/{robot.namespace}' for robot in options.per_robot()]
    place, words = claim_domain(os.environ, namespaces, './wasd topics')
    if words:
        print(f'wasd: {words}', file=sys.stderr, flush=True)
    with place or contextlib.nullcontext():
        yield


def with_own_frames(ros_arguments: Sequence[str]) -> list[str]:
    """
    Return ROS arguments in which a namespace has a clock and a tree of frames of its own.

    A rule of the user's for /clock, /tf or /tf_static comes first, so it holds.
    """
    words = list(ros_arguments)
    if namespaces_of(words) == ['/']:
        return words
    if '--' in words:
        words = words[: words.index('--')]
    rules = [word for name, own in NAMESPACED for word in ('-r', f'{name}:={own}')]
    return [*words, *rules]
