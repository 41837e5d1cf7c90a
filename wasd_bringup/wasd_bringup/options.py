# SPDX-License-Identifier: Apache-2.0
"""What a run is asked to be: the options of `wasd mbot` (and `go2`), checked and read."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import math
from pathlib import Path

from teleop_keyboard.key_script import KeyPress
from teleop_keyboard.key_script import parse_key_script
from teleop_keyboard.layouts import LAYOUTS

from wasd_bringup.errors import UsageError
from wasd_bringup.scripts import parse_push
from wasd_bringup.scripts import parse_twist_script
from wasd_bringup.scripts import ScriptedPush
from wasd_bringup.scripts import ScriptedTwist

WORLD_NAMES = 'flat, room, slope:DEG, stairs:RISE, step:HEIGHT, boxes:HEIGHT, rough:HEIGHT'
MODES = ('sim', 'fake', 'float', 'arbotix')
VIEWERS = ('web', 'native', 'none')
# The robots and their usual keymaps.
PRESETS = {'go2': 'unitree', 'mbot': 'mbot'}
# A scripted run without --duration goes on for so long after its last line [s].
AFTERGLOW = 2.0


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
    keys: tuple[KeyPress, ...] | None = None
    twists: tuple[ScriptedTwist, ...] | None = None
    pushes: tuple[ScriptedPush, ...] = ()
    duration: float = math.inf
    speed: float = 1.0
    seed: int = 0
    record: Path | None = None
    report: Path | None = None
    save_keys: str | None = None
    estimator: str = 'kalman'
    limits: str = 'sport'
    mode: str | None = None
    controller: Path | None = None
    interactive: bool = False

    @property
    def scripted(self) -> bool:
        """Whether keys or velocities come from a file."""
        return self.keys is not None or self.twists is not None

    def per_robot(self) -> tuple['RunOptions', ...]:
        """Return the options of each robot: themselves, or those of the two of `both`."""
        if self.robot != 'both':
            return (self,)
        return tuple(
            replace(self, robot=name, description=name, namespace=name, preset=preset)
            for name, preset in PRESETS.items()
        )


def add_run_options(parser: argparse.ArgumentParser, robot: str) -> None:
    """Declare the options of a robot's command."""
    parser.set_defaults(robot=robot)
    parser.add_argument(
        '--description', default=robot, metavar='PATH', help='a xacro or URDF of your own'
    )
    parser.add_argument(
        '--package-path',
        action='append',
        default=[],
        metavar='DIR',
        help='where package:// and $(find) look first (repeatable)',
    )
    parser.add_argument(
        '--xacro-arg',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='an argument of the xacro file (repeatable)',
    )
    parser.add_argument(
        '--strict',
        action='store_true',
        help='refuse a description whose meshes are not where it says',
    )
    preset = PRESETS[robot]
    parser.add_argument(
        '--preset', default=preset, metavar='NAME', help=f'keymap (default: {preset})'
    )
    parser.add_argument('--twist', metavar='FILE', help='scripted velocities: "t vx vy wz"')
    parser.add_argument(
        '--push',
        action='append',
        default=[],
        metavar='"T FX FY FZ S"',
        help='a force on the robot, world frame [N] (repeatable)',
    )
    _add_shared_options(parser)


def add_both_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command for both robots, which are the built-in ones."""
    parser.set_defaults(
        robot='both',
        description='both',
        package_path=[],
        xacro_arg=[],
        strict=False,
        preset='',
        twist=None,
        push=[],
    )
    _add_shared_options(parser)


def _add_shared_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of a run, whoever runs."""
    parser.add_argument(
        '--viewer',
        choices=VIEWERS,
        help='web: a page on 127.0.0.1; native: a window (default: web on a terminal, else none)',
    )
    parser.add_argument(
        '--port', type=int, default=0, metavar='N', help='port of the page (default: 8080 or next)'
    )
    parser.add_argument(
        '--world', default='flat', metavar='NAME|FILE', help=f'{WORLD_NAMES}, or a model file'
    )
    parser.add_argument(
        '--layout', choices=LAYOUTS, default='qwerty', help='your keyboard (default: qwerty)'
    )
    parser.add_argument('--play', metavar='FILE', help='scripted keys: lines "t key [key ...]"')
    parser.add_argument('--duration', metavar='S', help='stop after S simulated seconds')
    parser.add_argument(
        '--speed',
        default='1',
        metavar='X',
        help='real-time factor aimed at; 0: as fast as it goes (default 1)',
    )
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='seed (default 0)')
    parser.add_argument('--save-keys', metavar='FILE', help='write the keys, as --play reads them')
    parser.add_argument('--record', metavar='FILE.mcap', help='record every topic')
    parser.add_argument('--report', metavar='FILE', help='write what happened as JSON')


def add_wheeled_options(parser: argparse.ArgumentParser) -> None:
    """Declare what only a wheeled robot's command has."""
    parser.add_argument(
        '--mode',
        choices=MODES,
        help='fake: no physics, wheels do as told; sim: physics, a PID loop turns the wheels '
        '(float; default); arbotix: physics, and the integer loop of the ArbotiX board',
    )
    parser.add_argument(
        '--controller',
        metavar='FILE',
        help="YAML with the drive's parameters: arbotix's, ros2_controllers' or your own",
    )


def add_legged_options(parser: argparse.ArgumentParser) -> None:
    """Declare what only a legged robot's command has."""
    parser.add_argument(
        '--estimator',
        choices=('kalman', 'truth'),
        default='kalman',
        help='what feeds the controller: IMU and legs (default), or the simulator without noise',
    )
    parser.add_argument(
        '--limits',
        choices=('sport', 'guide'),
        default='sport',
        help="full stick: what the controller is good for (default), or unitree_guide's",
    )


def read_options(arguments: argparse.Namespace) -> RunOptions:
    """
    Check the parsed options and read the files they name.

    Raises:
        UsageError, KeyScriptError: what is wrong, in one line.
    """
    if arguments.seed < 0:
        raise UsageError(f'--seed: got {arguments.seed}, wanted >= 0')
    if not 0 <= arguments.port <= 65535:
        raise UsageError(f'--port: got {arguments.port}, wanted 0 to 65535')
    keys = twists = None
    if arguments.play is not None:
        keys = tuple(parse_key_script(_read(arguments.play, '--play'), arguments.play))
    if arguments.twist is not None:
        twists = tuple(parse_twist_script(_read(arguments.twist, '--twist'), arguments.twist))
    duration = math.inf
    if arguments.duration is not None:
        duration = _number(arguments.duration, '--duration')
    elif keys is not None or twists is not None:
        times = [press.time for press in keys or ()] + [twist.time for twist in twists or ()]
        duration = AFTERGLOW + max(times, default=0.0)
    return RunOptions(
        robot=arguments.robot,
        description=arguments.description,
        package_path=_folders(arguments.package_path),
        xacro_arguments=dict(_assignment(text) for text in arguments.xacro_arg),
        strict=arguments.strict,
        world=arguments.world,
        preset=arguments.preset,
        layout=arguments.layout,
        viewer=arguments.viewer,
        port=arguments.port,
        keys=keys,
        twists=twists,
        pushes=tuple(parse_push(text) for text in arguments.push),
        duration=duration,
        speed=_number(arguments.speed, '--speed'),
        seed=arguments.seed,
        record=_writable(arguments.record, '--record'),
        report=_writable(arguments.report, '--report'),
        save_keys=arguments.save_keys,
        estimator=getattr(arguments, 'estimator', 'kalman'),
        limits=getattr(arguments, 'limits', 'sport'),
        mode=getattr(arguments, 'mode', None),
        controller=_file(getattr(arguments, 'controller', None), '--controller'),
    )


def _read(path: str, option: str) -> str:
    try:
        return Path(path).read_text(encoding='utf-8')
    except UnicodeDecodeError:
        raise UsageError(f'{option} {path}: not a text file') from None
    except OSError as error:
        raise UsageError(f'{option} {path}: {error.strerror}') from None


def _file(path: str | None, option: str) -> Path | None:
    if path is not None and not Path(path).is_file():
        raise UsageError(f'{option} {path}: no such file')
    return None if path is None else Path(path)


def _number(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        raise UsageError(f'{option}: got {text!r}, wanted a number >= 0')
    return value


def _folders(paths: Sequence[str]) -> tuple[Path, ...]:
    for path in paths:
        if not Path(path).is_dir():
            raise UsageError(f'--package-path {path}: no such folder')
    return tuple(Path(path).resolve() for path in paths)


def _assignment(text: str) -> tuple[str, str]:
    name, separator, value = text.partition(':=')
    if not name or not separator:
        raise UsageError(f'--xacro-arg {text}: wanted NAME:=VALUE')
    return name, value


def _writable(path: str | None, option: str) -> Path | None:
    """Return where a file goes; says now, not after the run, that it cannot be written."""
    if path is None:
        return None
    target = Path(path)
    if target.is_dir() or not target.absolute().parent.is_dir():
        raise UsageError(f'{option} {path}: wanted a file in a folder that exists')
    return target
