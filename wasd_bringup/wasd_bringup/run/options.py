# SPDX-License-Identifier: Apache-2.0
"""What a run is asked to be: the options of `wasd go2` and the like, checked and read."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
import errno
import functools
import math
import os
from pathlib import Path
import stat
from typing import TYPE_CHECKING

from mujoco_sim.parameters import Payload, Untold
from teleop_keyboard.key_script import KeyPress, parse_key_script
from wasd_core.errors import DescriptionError, one_line, UserError
from wasd_core.network import SAYS_WHO, set_range
from wasd_core.output_file import check_apart, OutputFile
from wasd_core.safe_files import read_file

from wasd_bringup.robots import BOTH, ROBOTS, robots_of, WHEELED
from wasd_bringup.run.inputs import (
    Command,
    Goal,
    parse_box,
    parse_goal,
    parse_push,
    parse_twist_script,
    ScriptedBox,
    ScriptedPush,
    ScriptedTwist,
)

if TYPE_CHECKING:
    from diff_drive_sim.controller_file import ControllerFile

# What a namespace keeps apart, too: a robot alone in its world has its own time and frames.
NAMESPACED = (('/clock', 'clock'), ('/tf', 'tf'), ('/tf_static', 'tf_static'))
# A seed is a parameter, too, of 64 bits.
MOST_SEED = 2**63 - 1
# Values of --discovery; rcl knows them in capitals.
RANGES = ('off', 'localhost', 'subnet')
# So long a run may be asked for [s]: thirty years.
LONGEST_RUN = 1e9
# A scripted run without --duration goes on for so long after its last line [s].
AFTERGLOW = 2.0

# Options that a run takes as they were given.
AS_GIVEN = (
    *('robot', 'description', 'strict', 'world', 'preset', 'layout', 'viewer', 'port'),
    *('seed', 'discovery', 'gamepad', 'foxglove', 'latched'),
)


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """One run; files are read, times in simulated seconds."""

    robot: str
    description: str
    namespace: str = ''
    package_path: tuple[Path, ...] = ()
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    strict: bool = False
    world: str = 'flat'
    preset: str = ''
    layout: str = 'qwerty'
    viewer: str | None = None
    port: int = 0
    opens_page: bool = True
    keys: tuple[KeyPress, ...] | None = None
    twists: tuple[ScriptedTwist, ...] | None = None
    pushes: tuple[ScriptedPush, ...] = ()
    boxes: tuple[ScriptedBox, ...] = ()
    duration: float = math.inf
    speed: float = 1.0
    seed: int = 0
    untold: Untold = Untold()
    record: OutputFile | None = None
    report: OutputFile | None = None
    save_keys: OutputFile | None = None
    # Whether Session.report has samples; with a report to write they are kept anyway.
    samples: bool = False
    discovery: str | None = None
    estimator: str = 'kalman'
    limits: str | None = None
    gait: str | None = None
    mode: str | None = None
    controller: Path | None = None
    gamepad: str | None = None  # None: no pad; '': the first that comes
    foxglove: int | None = None  # the port
    # The map to localise in; '' makes one, None does neither.
    map: str | None = None
    save_map: str | None = None  # without .yaml
    goals: tuple[Goal, ...] = ()
    latched: bool = False  # whether an e-stop holds until it is released
    interactive: bool = False
    words: tuple[str, ...] = ()  # of the command line, where there is one
    # Of a recording: the descriptions by namespace, and the commands in place of all others.
    urdfs: Mapping[str, str] = field(default_factory=dict)
    commands: tuple[Command, ...] | None = None

    @property
    def keeps_samples(self) -> bool:
        """Whether what happens is kept for a report."""
        return self.samples or self.report is not None

    @property
    def scripted(self) -> bool:
        """Whether keys or velocities come from a file."""
        return self.keys is not None or self.twists is not None

    @property
    def navigates(self) -> bool:
        """Whether the robot maps, or finds its way in a map."""
        return self.map is not None

    @property
    def prints_data(self) -> bool:
        """Whether standard output is a file of data, between which no words may come."""
        outputs = (self.record, self.report, self.save_keys)
        return any(output is not None and output.is_standard_output for output in outputs)

    @property
    def has_guests(self) -> bool:
        """Whether somebody may drive who comes and goes."""
        return self.gamepad is not None or self.foxglove is not None

    @functools.cached_property
    def drive_file(self) -> 'ControllerFile | None':
        """
        What the file of --controller says of wheels; it is read once.

        Raises:
            InvalidParameter: what is wrong with it.
        """
        if self.controller is None or ROBOTS[self.robot].kind is not WHEELED:
            return None
        # Here, because it loads YAML and numpy, which --help does without.
        from diff_drive_sim.controller_file import read_controller_file

        return read_controller_file(str(self.controller))

    @property
    def drive_mode(self) -> str | None:
        """
        The mode that the command line asks for; None: the file's, or the default.

        `sim` is whichever loop the file asks for, as long as there is one.
        """
        if self.mode != 'sim':
            return self.mode
        return 'float' if self._mode_of_file == 'fake' else None

    @property
    def is_fake(self) -> bool:
        """Whether the robot is to move without physics."""
        return (self.mode or self._mode_of_file) == 'fake'

    @property
    def _mode_of_file(self) -> str | None:
        file = self.drive_file
        return None if file is None else file.parameters.mode

    def per_robot(self) -> tuple['RunOptions', ...]:
        """Return the options of each robot: themselves, or those of the robots of `both`."""
        if self.robot != BOTH:
            return (self,)
        return tuple(
            replace(
                self,
                robot=row.name,
                description=row.description,
                namespace=row.name,
                preset=row.preset,
            )
            for row in robots_of(self.robot)
        )


# A script of keys that were held for a day has 70 MB [bytes].
LARGEST_SCRIPT = 100_000_000


def read_options(arguments: argparse.Namespace) -> RunOptions:
    """
    Check the parsed options and read the files they name.

    Raises:
        UserError, KeyScriptError: what is wrong, in one line.
    """
    _check_whole_numbers(arguments)
    keys = twists = None
    if arguments.play is not None:
        keys = tuple(parse_key_script(_read(arguments.play, '--play'), arguments.play))
    if arguments.twist is not None:
        twists = tuple(parse_twist_script(_read(arguments.twist, '--twist'), arguments.twist))
    duration = math.inf
    if arguments.duration is not None:
        duration = read_number(arguments.duration, '--duration')
        if duration > LONGEST_RUN:
            raise UserError(f'--duration: got {duration:g}, wanted at most {LONGEST_RUN:g} s')
    elif keys is not None or twists is not None:
        times = [press.time for press in keys or ()] + [twist.time for twist in twists or ()]
        duration = AFTERGLOW + max(times, default=0.0)
    outputs = _outputs(arguments)
    _check_navigation(arguments)
    return RunOptions(
        **{name: getattr(arguments, name) for name in AS_GIVEN},
        package_path=read_folders(arguments.package_path),
        xacro_arguments=dict(_assignment(text) for text in arguments.xacro_arg),
        opens_page=not arguments.no_open,
        keys=keys,
        twists=twists,
        pushes=tuple(parse_push(text) for text in arguments.push),
        boxes=tuple(parse_box(text) for text in arguments.box),
        duration=duration,
        speed=read_number(arguments.speed, '--speed'),
        untold=_untold(arguments),
        record=outputs['record'],
        report=outputs['report'],
        save_keys=outputs['save_keys'],
        map=_map(arguments),
        save_map=None if arguments.save_map is None else arguments.save_map.removesuffix('.yaml'),
        goals=tuple(parse_goal(text) for text in arguments.goal),
        estimator=getattr(arguments, 'estimator', 'kalman'),
        limits=getattr(arguments, 'limits', None),
        gait=getattr(arguments, 'gait', None),
        mode=getattr(arguments, 'mode', None),
        controller=_file(getattr(arguments, 'controller', None), '--controller'),
    )


def _check_whole_numbers(arguments: argparse.Namespace) -> None:
    if not 0 <= arguments.seed <= MOST_SEED:
        raise UserError(f'--seed: got {arguments.seed}, wanted 0 to {MOST_SEED}')
    for name in ('port', 'foxglove'):
        port = getattr(arguments, name)
        if port is not None and not 0 <= port <= 65535:
            raise UserError(f'--{name}: got {port}, wanted 0 to 65535')


def _map(arguments: argparse.Namespace) -> str | None:
    """Return the map to localise in, '' to make one, None for neither."""
    if arguments.map:
        _file(arguments.map, '--map')
    asks = arguments.save_map is not None or arguments.goal
    return '' if arguments.map is None and asks else arguments.map


def _check_navigation(arguments: argparse.Namespace) -> None:
    if arguments.robot == BOTH and (arguments.map or arguments.save_map or arguments.goal):
        raise UserError(
            '--map FILE, --save-map and --goal are for one robot: wasd go2, or wasd mbot '
            '(wasd both takes --map alone: each robot makes a map of its own)'
        )


def _read(path: str, option: str) -> str:
    try:
        # For the system's own words; without a wait for who writes to a pipe.
        open(path, 'rb', opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)).close()
        # As some editors save it, a text begins with a byte order mark.
        return read_file(Path(path), LARGEST_SCRIPT).decode('utf-8-sig')
    except UnicodeDecodeError:
        raise UserError(f'{option} {path}: not a text file') from None
    except DescriptionError as error:
        raise UserError(f'{option} {error}') from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise UserError(f'{option} {path}: {one_line(error)}') from None


def _file(path: str | None, option: str) -> Path | None:
    if path is not None and not stat.S_ISREG(_mode(path, option, 'file')):
        raise UserError(f'{option} {path}: is no file')
    return None if path is None else Path(path)


def _mode(path: str, option: str, kind: str) -> int:
    """Return what a path leads to, and its permissions, as stat does."""
    try:
        return os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f'{option} {path}: no such {kind}') from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise UserError(f'{option} {path}: {one_line(error)}') from None


def read_number(text: str, option: str) -> float:
    """
    Return the value of an option.

    Raises:
        UserError: it is not a number >= 0.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        raise UserError(f'{option}: got {text!r}, wanted a number >= 0')
    return value


def _untold(arguments: argparse.Namespace) -> Untold:
    text = arguments.friction
    friction = None if text is None else read_number(text, '--friction')
    level = read_number(getattr(arguments, 'randomise', '0'), '--randomise')
    drift = read_number(getattr(arguments, 'imu_drift', '1'), '--imu-drift')
    try:
        payload = None if arguments.payload is None else Payload.parse(arguments.payload)
        return Untold(friction=friction, payload=payload, randomise=level, imu_drift=drift)
    except UserError as error:
        raise UserError(f'--{error}') from None


def read_folders(paths: Sequence[str]) -> tuple[Path, ...]:
    """
    Return the folders of --package-path.

    Raises:
        UserError: one is none.
    """
    for path in paths:
        if not stat.S_ISDIR(_mode(path, '--package-path', 'folder')):
            raise UserError(f'--package-path {path}: no such folder')
        if not os.access(path, os.R_OK | os.X_OK):
            raise UserError(f'--package-path {path}: {os.strerror(errno.EACCES)}')
    return tuple(Path(path).resolve() for path in paths)


def _assignment(text: str) -> tuple[str, str]:
    name, separator, value = text.partition(':=')
    if not name or not separator:
        raise UserError(f'--xacro-arg {text}: wanted NAME:=VALUE')
    return name, value


def _outputs(arguments: argparse.Namespace) -> dict[str, OutputFile | None]:
    """
    Return where files go; says now, not after the run, that one cannot be written.

    Raises:
        OutputError: why not, or that it is an input, or another output.
    """
    outputs = {}
    for name in ('record', 'report', 'save_keys'):
        path = getattr(arguments, name)
        option = f'--{name.replace("_", "-")}'
        outputs[name] = None if path is None else OutputFile(path, option)
    maps: tuple[OutputFile, ...] = ()
    if getattr(arguments, 'save_map', None) is not None:
        # Here, because few runs save a map.
        from wasd_navigation.mapping import map_outputs

        maps = map_outputs(Path(arguments.save_map), '--save-map')
    inputs = []
    for name in ('play', 'twist', 'controller', 'description', 'preset', 'world', 'map'):
        path = getattr(arguments, name, None)
        if path is not None and os.path.exists(path):
            inputs.append((f'--{name}', path))
    check_apart([output for output in (*outputs.values(), *maps) if output is not None], inputs)
    return outputs


def keep_alone() -> None:
    """
    Have what is initialised next talk to no other process, whatever the environment says.

    An experiment is to be repeated: not even another run on this machine may join it.
    """
    set_range(os.environ, 'off')


def choose_range(asked: str | None, is_experiment: bool) -> None:
    """
    Set the range of a run: as asked, else off for an experiment, else what the user has set.

    Who has set nothing keeps to this machine, by `init_ros`: a classroom shares a network, and
    nobody is to drive the neighbour's robot by accident. Asked for by name, that holds whatever
    the environment says.
    """
    if asked == 'localhost':
        for name in SAYS_WHO:
            os.environ.pop(name, None)
    elif asked is not None:
        set_range(os.environ, asked)
    elif is_experiment:
        keep_alone()
