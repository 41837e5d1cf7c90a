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
from wasd_core.output_file import check_apart
from wasd_core.output_file import OutputFile

from wasd_bringup.errors import UsageError
from wasd_bringup.scripts import Command
from wasd_bringup.scripts import parse_push
from wasd_bringup.scripts import parse_twist_script
from wasd_bringup.scripts import ScriptedPush
from wasd_bringup.scripts import ScriptedTwist

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
    record: OutputFile | None = None
    report: OutputFile | None = None
    save_keys: OutputFile | None = None
    # Whether Session.report has samples; with a report to write they are kept anyway.
    samples: bool = False
    discovery: str | None = None
    estimator: str = 'kalman'
    limits: str | None = None
    mode: str | None = None
    controller: Path | None = None
    interactive: bool = False
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

    def per_robot(self) -> tuple['RunOptions', ...]:
        """Return the options of each robot: themselves, or those of the two of `both`."""
        if self.robot != 'both':
            return (self,)
        return tuple(
            replace(self, robot=name, description=name, namespace=name, preset=preset)
            for name, preset in PRESETS.items()
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
        duration = read_number(arguments.duration, '--duration')
    elif keys is not None or twists is not None:
        times = [press.time for press in keys or ()] + [twist.time for twist in twists or ()]
        duration = AFTERGLOW + max(times, default=0.0)
    outputs = _outputs(arguments)
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
        speed=read_number(arguments.speed, '--speed'),
        seed=arguments.seed,
        record=outputs['record'],
        report=outputs['report'],
        save_keys=outputs['save_keys'],
        discovery=arguments.discovery,
        estimator=getattr(arguments, 'estimator', 'kalman'),
        limits=getattr(arguments, 'limits', None),
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


def read_number(text: str, option: str) -> float:
    """
    Return the value of an option.

    Raises:
        UsageError: it is not a number >= 0.
    """
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
    inputs = []
    for name in ('play', 'twist', 'controller', 'description', 'preset', 'world'):
        path = getattr(arguments, name, None)
        if path is not None and Path(path).exists():
            inputs.append((f'--{name}', path))
    check_apart([output for output in outputs.values() if output is not None], inputs)
    return outputs
