# SPDX-License-Identifier: Apache-2.0
"""
The options of a run: each row has an option's help and the reader of its value.

An option needs only its row: argparse, `--help` and `RunOptions` follow. Its default is that of
the field in `RunOptions`.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
import dataclasses
from dataclasses import dataclass
import errno
from functools import partial
import os
from pathlib import Path
import stat
from typing import Any

from mujoco_sim.parameters import (
    HEAVIEST,
    LIDAR_NAMES,
    Payload,
    SimulatorParameters,
    Untold,
    WORLD_KINDS,
    WORLD_NAMES,
)
from quadruped_sim.presets import GAITS, LIMITS
from teleop_keyboard.key_script import parse_key_script
from teleop_keyboard.keymap import LAYOUTS
from wasd_core.command_line import OneLineParser
from wasd_core.errors import DescriptionError, one_line, UserError
from wasd_core.network import LAST_DOMAIN
from wasd_core.output_file import check_apart, OutputFile
from wasd_core.safe_files import read_file

from wasd_bringup.robots import BOTH, LEGS, LEGS_ALONE, MODES, POLICY, ROBOTS, WHEELS
from wasd_bringup.run.inputs import parse_box, parse_goal, parse_push, parse_twist_script
from wasd_bringup.run.options import AFTERGLOW, RANGES, RunOptions, SCANS

# A seed is a parameter, too, of 64 bits.
MOST_SEED = 2**63 - 1
# The longest duration of a run [s]: thirty years.
LONGEST_RUN = 1e9
# A script of keys that are held for a day has 70 MB [bytes].
LARGEST_SCRIPT = 100_000_000
MOST_PORT = 65535
# Where Foxglove looks first.
FOXGLOVE_PORT = 8765
# An option's value where none followed it: '' is what somebody typed.
ALONE = True
VIEWERS = ('web', 'native', 'none')
# Which commands have an option: every run, or those of one robot; a kind of robots names others.
EVERY, ONE = 'every run', 'one robot'

Read = Callable[[Any, str], Any]


@dataclass(frozen=True, kw_only=True)
class Option:
    """
    One option: `read(value, word)` converts the given text to the value of a field of RunOptions.

    `how` has argparse's arguments. A field with a dot belongs to a part of RunOptions. `{name}` in
    `help` is a fact of the robot's row; `usual` names the fact that is the default.

    Raises:
        UserError: `read` says what is wrong with the value.
    """

    word: str
    help: str
    field: str = ''  # default: the word's own name
    read: Read = lambda value, word: value
    of: str = EVERY
    usual: str = ''
    needs: str = ''  # what a run must have, else the option is without effect: see `Run.has`
    how: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def name(self) -> str:
        """The field of RunOptions."""
        return self.field or self.attribute

    @property
    def attribute(self) -> str:
        """The attribute of argparse's namespace."""
        return self.word.removeprefix('--').replace('-', '_')


def read_text(path: str, word: str) -> str:
    """
    Return what a file says.

    Raises:
        UserError: it cannot be read, or is no text.
    """
    try:
        # Some editors begin a text with a byte order mark.
        return read_file(Path(path), LARGEST_SCRIPT).decode('utf-8-sig')
    except UnicodeDecodeError:
        raise UserError(f'{word} {path}: not a text file') from None
    except DescriptionError as error:
        raise UserError(f'{word} {error}') from None


def read_script(parse: Callable[[str, str], Sequence[Any]], path: str, word: str) -> Any:
    """Return the events of a script."""
    return tuple(parse(read_text(path, word), path))


def read_number(text: str, word: str, most: float = 0.0) -> float:
    """
    Return a number.

    Raises:
        UserError: it is not a number >= 0, or is more than `most` [s].
    """
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float('inf'):
        raise UserError(f'{word}: got {text!r}, wanted a number >= 0')
    if most and value > most:
        raise UserError(f'{word}: got {value:g}, wanted at most {most:g} s')
    return value


def read_speed(text: str, word: str) -> float:
    """
    Return a real-time factor; `SimulatorParameters` knows its bounds.

    Raises:
        UserError: it is none.
    """
    speed = read_number(text, word)
    return float(_untold(lambda: SimulatorParameters(speed=speed)).speed)


def read_untold(text: str, word: str) -> float:
    """
    Return a number; `Untold` knows its bounds.

    Raises:
        UserError: it is not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise UserError(f'{word}: got {text!r}, wanted a number') from None


def read_whole(most: int, given: str | int, word: str) -> int:
    """
    Return a whole number.

    Raises:
        UserError: it is none, or not from 0 to the most.
    """
    try:
        value = int(given)
    except ValueError:
        value = -1
    if not 0 <= value <= most:
        raise UserError(f'{word}: got {given!r}, wanted 0 to {most}')
    return value


def read_file_name(path: str, word: str) -> Path:
    """
    Return the path of a file.

    Raises:
        UserError: there is none.
    """
    if not stat.S_ISREG(_mode(path, word, 'file')):
        raise UserError(f'{word} {path}: not a file')
    return Path(path)


def read_map(path: str | bool, word: str) -> str:
    """
    Return the map to localise in; '' makes one, where the word stood ALONE.

    Raises:
        UserError: there is no such file.
    """
    # Here, because few runs have a map.
    from wasd_core.map_picture import yaml_beside

    if isinstance(path, bool):
        return ''
    try:
        read_file_name(path, word)
    except UserError as error:
        raise UserError(f'{error}{yaml_beside(path)}') from None
    return path


def read_keepout(words: str, word: str) -> str:
    """
    Return the words for areas to keep out of.

    Raises:
        UserError: their files are none.
    """
    # Here, because few runs have such areas.
    from wasd_core.map_picture import read_plan

    try:
        read_plan(words)
    except UserError as error:
        raise UserError(f'{word} {error}') from None
    return words


def read_map_name(path: str, word: str) -> str:
    """Return the common name of a map's files; `path` may be one of them."""
    # Here, because few runs save a map.
    from wasd_navigation.mapping import without_ending

    return str(without_ending(Path(path)))


def read_folders(
    paths: Sequence[str | os.PathLike[str]], word: str = '--package-path'
) -> tuple[Path, ...]:
    """
    Return folders.

    Raises:
        UserError: a path is no folder, or cannot be entered.
    """
    for path in paths:
        if not stat.S_ISDIR(_mode(path, word, 'folder')):
            raise UserError(f'{word} {path}: no such folder')
        if not os.access(path, os.R_OK | os.X_OK):
            raise UserError(f'{word} {path}: {os.strerror(errno.EACCES)}')
    return tuple(Path(path).resolve() for path in paths)


def read_assignments(texts: Sequence[str], word: str) -> dict[str, str]:
    """
    Return names and values.

    Raises:
        UserError: a text is no NAME:=VALUE.
    """
    found = {}
    for text in texts:
        name, separator, value = text.partition(':=')
        if not name or not separator:
            raise UserError(f'{word} {text}: wanted NAME:=VALUE')
        found[name] = value
    return found


def _mode(path: str | os.PathLike[str], word: str, kind: str) -> int:
    """Return the type and permissions of a path's target, as stat does."""
    try:
        return os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f'{word} {path}: no such {kind}') from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise UserError(f'{word} {path}: {one_line(error)}') from None


FLAG = {'action': 'store_true'}
REPEATABLE = {'action': 'append'}

OPTIONS = (
    Option(
        word='--description',
        help='your own xacro or URDF',
        of=ONE,
        usual='description',
        how={'metavar': 'PATH'},
    ),
    Option(
        word='--package-path',
        help='folder that package:// and $(find) search first (repeatable)',
        of=ONE,
        read=read_folders,
        how={**REPEATABLE, 'metavar': 'DIR'},
    ),
    Option(
        word='--xacro-arg',
        help='an argument of the xacro file (repeatable)',
        of=ONE,
        field='xacro_arguments',
        read=read_assignments,
        how={**REPEATABLE, 'metavar': 'NAME:=VALUE'},
    ),
    Option(
        word='--strict',
        help='refuse a description if a mesh is broken or not where it says',
        of=ONE,
        how=FLAG,
    ),
    Option(
        word='--preset',
        help='keymap (default: {preset})',
        of=ONE,
        usual='preset',
        how={'metavar': 'NAME|FILE'},
    ),
    Option(
        word='--twist',
        help='scripted velocities: "t vx vy wz"',
        of=ONE,
        field='twists',
        read=partial(read_script, parse_twist_script),
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--push',
        needs='physics',
        help='push the robot for S seconds, world frame [N] (repeatable); three more numbers give '
        "a point in the base's frame [m]; default: the centre of mass",
        of=ONE,
        field='pushes',
        read=lambda texts, word: tuple(map(parse_push, texts)),
        how={**REPEATABLE, 'metavar': '"T FX FY FZ S"'},
    ),
    Option(
        word='--payload',
        needs='physics',
        help=f'add a load to the base, <= {HEAVIEST:g} kg (a Go2 carries 8), at a point in its '
        'frame [m], unknown to the controller (default: none; at the origin)',
        of=ONE,
        field='untold.payload',
        read=lambda text, word: _untold(lambda: Payload.parse(text)),
        how={'metavar': 'KG[@X,Y,Z]'},
    ),
    Option(
        word='--viewer',
        help='web: a page on 127.0.0.1; native: a window (default: web on a terminal without a '
        'script, else none)',
        how={'choices': VIEWERS},
    ),
    Option(
        word='--port',
        needs='page',
        help='port of the page (default: 8080 or next)',
        read=partial(read_whole, MOST_PORT),
        how={'metavar': 'N'},
    ),
    Option(
        word='--no-open',
        needs='page',
        help="print the page's address, but do not open it in your browser",
        field='opens_page',
        read=lambda given, word: not given,
        how=FLAG,
    ),
    Option(
        word='--world',
        help=f'{WORLD_NAMES}, {WORLD_KINDS}',
        how={'metavar': 'NAME|FILE'},
    ),
    Option(
        word='--box',
        help='put a box there [m] at time T [s] (repeatable); optional: yaw [rad], then length '
        'and width [m]',
        field='boxes',
        read=lambda texts, word: tuple(map(parse_box, texts)),
        how={**REPEATABLE, 'metavar': '"T X Y"'},
    ),
    Option(word='--layout', help='your keyboard (default: qwerty)', how={'choices': LAYOUTS}),
    Option(
        word='--latched',
        help='keep an E-STOP (ESC, page, topic, service) until ENTER, the page or a service '
        'releases it',
        how=FLAG,
    ),
    Option(
        word='--guard',
        help='slow down and stop before any obstacle that the lidar sees, with any driver',
        how=FLAG,
    ),
    Option(
        word='--gamepad',
        help='drive with a gamepad, too (default: the first /dev/input/js* that appears)',
        read=lambda given, word: '' if given is ALONE else given,
        how={'nargs': '?', 'const': ALONE, 'metavar': 'DEVICE'},
    ),
    Option(
        word='--foxglove',
        help=f'serve every topic to Foxglove, which may drive (default port: {FOXGLOVE_PORT})',
        read=partial(read_whole, MOST_PORT),
        how={'nargs': '?', 'const': FOXGLOVE_PORT, 'metavar': 'PORT'},
    ),
    Option(
        word='--map',
        help='map while driving, or localise in a saved map; a click in the panel Map sets a '
        'goal, or in the scene with the pointer of the panel View',
        read=read_map,
        how={'nargs': '?', 'const': ALONE, 'metavar': 'FILE.yaml'},
    ),
    Option(
        word='--continue',
        help='continue the map of --map FILE.yaml: localise in it, then map',
        field='continues',
        of=ONE,
        how=FLAG,
    ),
    Option(
        word='--keepout',
        help='areas that the robot keeps out of: black in FILE.yaml (map_server) or in '
        'PICTURE,METRES_PER_PIXEL',
        read=read_keepout,
        of=ONE,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--explore',
        help='map all that the robot can reach, without a driver, then return to the start',
        how=FLAG,
    ),
    Option(
        word='--save-map',
        help='write the map at the end: NAME.yaml, NAME.pgm; of its own NAME.places.npz, too',
        read=read_map_name,
        of=ONE,
        how={'metavar': 'NAME'},
    ),
    Option(
        word='--goal',
        help='drive to a pose in the map [m, rad] (repeatable: one after another)',
        field='goals',
        read=lambda texts, word: tuple(map(parse_goal, texts)),
        of=ONE,
        how={**REPEATABLE, 'metavar': '"X Y [YAW]"'},
    ),
    Option(
        word='--patrol',
        help='drive to the goals of --goal again and again',
        of=ONE,
        how=FLAG,
    ),
    Option(
        word='--play',
        help='press scripted keys: lines "t key [key ...]"',
        field='keys',
        read=partial(read_script, parse_key_script),
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--duration',
        help='stop after S simulated seconds',
        read=partial(read_number, most=LONGEST_RUN),
        how={'metavar': 'S'},
    ),
    Option(
        word='--speed',
        help='target real-time factor; 0: as fast as possible (default 1)',
        read=read_speed,
        how={'metavar': 'X'},
    ),
    Option(
        word='--seed',
        help='seed (default 0)',
        read=partial(read_whole, MOST_SEED),
        how={'metavar': 'N'},
    ),
    Option(
        word='--friction',
        needs='physics',
        help='friction of feet or wheels, unknown to the controller (default: the robot file)',
        field='untold.friction',
        read=read_untold,
        how={'metavar': 'MU'},
    ),
    Option(
        word='--lidar',
        needs='lidar',
        help='honest: each ray at its own time, with noise and gaps (default); ideal: all rays at '
        'one time; or the model of a real planar lidar',
        how={'choices': LIDAR_NAMES},
    ),
    Option(
        word='--discovery',
        help='who may join over ROS: nobody, this machine, the network (default: '
        'ROS_AUTOMATIC_DISCOVERY_RANGE, else localhost; off for a script at --speed 0)',
        how={'choices': RANGES},
    ),
    Option(
        word='--no-ros',
        help='run without ROS: no topics, no recording',
        field='uses_ros',
        read=lambda given, word: not given,
        how=FLAG,
    ),
    Option(
        word='--save-keys',
        help='write the keys as a script for --play',
        read=OutputFile,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--record', help='record every topic', read=OutputFile, how={'metavar': 'FILE.mcap'}
    ),
    Option(
        word='--report',
        help='write samples and events as JSON',
        read=OutputFile,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--estimator',
        help='state estimate: from IMU and legs (default), or the true state without noise',
        of=LEGS,
        how={'choices': ('kalman', 'truth')},
    ),
    Option(
        word='--imu-drift',
        help='drift of the IMU, in multiples of a good MEMS; 0: none (default 1)',
        of=LEGS,
        field='untold.imu_drift',
        read=read_untold,
        how={'metavar': 'TIMES'},
    ),
    Option(
        word='--randomise',
        help='0 to 1: vary mass, friction, motors, delays and noise at random, by --seed, '
        'unknown to the controller (default 0)',
        of=LEGS,
        field='untold.randomise',
        read=read_untold,
        how={'metavar': 'LEVEL'},
    ),
    Option(
        word='--gait',
        help='first gait; the key n chooses the next one (default: trot)',
        of=LEGS,
        how={'choices': GAITS},
    ),
    Option(
        word='--limits',
        help="speeds at full stick: for any ground (sport, default), unitree_guide's (guide), or "
        'the fastest for a good floor (race)',
        of=LEGS,
        how={'choices': LIMITS},
    ),
    Option(
        word='--interface',
        help="unitree: let programs for Unitree's SDK command it, high and low level",
        of=LEGS,
        how={'choices': ('unitree',)},
    ),
    Option(
        word='--domain',
        help='DDS domain of the interface: 0 as on the robot (default), 1 as in unitree_mujoco',
        of=LEGS,
        read=partial(read_whole, LAST_DOMAIN),
        how={'metavar': 'N'},
    ),
    Option(
        word='--network',
        help='loopback of the interface (default: lo); no other network is used',
        of=LEGS,
        how={'metavar': 'NAME'},
    ),
    Option(
        word='--eyes',
        help='walk by sight: footholds on heights of the lidar; blind on unknown ground (key: e)',
        of=LEGS,
        how=FLAG,
    ),
    Option(
        word='--sync',
        help='time waits for the LowCmd that answers each LowState of the interface',
        of=LEGS,
        how=FLAG,
    ),
    Option(
        word='--controller',
        help="YAML with the leg controller's parameters",
        of=LEGS_ALONE,
        read=read_file_name,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--policy',
        help='walk with a network (2, then p): an ONNX or TorchScript file; for a Go2 also: ours',
        of=POLICY,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--policy-config',
        help='settings of its training: deploy.yaml of Isaac Lab, config.yaml of rl_sar, '
        'legged_gym or playground (default: its metadata, or such a file beside it)',
        of=POLICY,
        how={'metavar': 'FILE'},
    ),
    Option(
        word='--height-scan',
        help="heights for a network: from the robot's map (default), or the true ones",
        of=LEGS_ALONE,
        how={'choices': SCANS},
    ),
    Option(
        word='--mode',
        help='fake: no physics, wheels follow commands exactly; sim or float (default): physics '
        'and a PID loop; arbotix: physics and the integer loop of the ArbotiX board',
        of=WHEELS,
        how={'choices': MODES},
    ),
    Option(
        word='--controller',
        help="YAML with the drive's parameters: arbotix's, ros2_controllers' or your own",
        of=WHEELS,
        read=read_file_name,
        how={'metavar': 'FILE'},
    ),
)


def options_of(command: str) -> list[Option]:
    """Return the options of a command that runs robots."""
    places = {EVERY, LEGS} if command == BOTH else {EVERY, ONE, *ROBOTS[command].kind.options}
    return [option for option in OPTIONS if option.of in places]


def vain_words(arguments: argparse.Namespace, has: Mapping[str, bool]) -> list[str]:
    """Return the options that were given to a run without what they need."""
    return [
        option.word
        for option in options_of(arguments.robot)
        if not has.get(option.needs, True) and getattr(arguments, option.attribute) is not None
    ]


def place_of(word: str) -> str:
    """Return which commands run robots with an option, as a text; '' for none."""
    commands = [
        f'wasd {command}'
        for command in (*ROBOTS, BOTH)
        if any(option.word == word for option in options_of(command))
    ]
    return f'{word} is for {", ".join(commands)}' if commands else ''


def add_run_options(parser: OneLineParser, command: str) -> None:
    """Declare the options of a command that runs robots."""
    parser.set_defaults(robot=command)
    parser.place_of = place_of
    facts = vars(ROBOTS[command]) if command in ROBOTS else {}
    for option in options_of(command):
        default = facts.get(option.usual) if option.usual else None
        words = option.help.format_map(facts) if option.usual else option.help
        parser.add_argument(option.word, default=default, help=words, **option.how)


def read_options(arguments: argparse.Namespace) -> RunOptions:
    """
    Check the parsed options and read the files they name.

    Raises:
        UserError, KeyScriptError: what is wrong, in one line.
    """
    robot = arguments.robot
    fields: dict[str, Any] = {} if robot in ROBOTS else {'description': robot, 'preset': ''}
    untold: dict[str, Any] = {}
    for option in options_of(robot):
        given = getattr(arguments, option.attribute)
        if given == '':
            raise UserError(f"{option.word}: got '', wanted {option.how['metavar']}")
        if given is not None:
            part, _, name = option.name.rpartition('.')
            (untold if part else fields)[name] = option.read(given, option.word)
    options = RunOptions(robot=robot, untold=_untold(lambda: Untold(**untold)), **fields)
    needs_map = options.save_map is not None or options.keepout is not None
    if options.map is None and (needs_map or options.goals or options.explore):
        fields['map'] = ''
    if 'duration' not in fields and options.scripted:
        times = [press.time for press in options.keys or ()]
        times += [twist.time for twist in options.twists or ()]
        fields['duration'] = AFTERGLOW + max(times, default=0.0)
    _check_outputs(arguments, options)
    _check_navigation(options)
    for word in ('domain', 'network', 'sync'):
        if options.interface is None and getattr(arguments, word, None):
            raise UserError(f'--{word} is for --interface unitree')
    return RunOptions(robot=robot, untold=options.untold, **fields)


def _untold(make: Callable[[], Any]) -> Any:
    """Return what `make` returns; an error names the option. The controller does not know it."""
    try:
        return make()
    except UserError as error:
        name, rest = str(error).split(' ', 1)
        # No option is None.
        rest = rest.removesuffix(' or None')
        raise UserError(f'--{name.replace("_", "-")} {rest}') from None


def _check_navigation(options: RunOptions) -> None:
    if options.patrol and not options.goals:
        raise UserError('--patrol goes round by goals: wanted --goal "X Y [YAW]", more than once')
    if options.continues and not options.map:
        raise UserError('--continue goes on with a map: wanted --map FILE.yaml')
    if options.explore and options.map and not options.continues:
        raise UserError('--explore makes a map: leave out the file of --map, or --continue it')
    if options.robot == BOTH and options.map:
        raise UserError(
            '--map FILE is for one robot: wasd go2, or wasd mbot (wasd both takes --map alone: '
            'each robot makes a map of its own)'
        )


def _check_outputs(arguments: argparse.Namespace, options: RunOptions) -> None:
    """Refuse, before the run, an output that is also an input or another output."""
    outputs = [options.record, options.report, options.save_keys]
    if options.save_map is not None:
        # Here, because few runs save a map.
        from wasd_navigation.mapping import map_outputs, session_output

        outputs += map_outputs(Path(options.save_map), '--save-map')
        outputs.append(session_output(Path(options.save_map), '--save-map'))
    words = getattr(arguments, 'words', ())  # those for ROS are in it
    pairs = zip(words, words[1:], strict=False)
    inputs = [pair for pair in pairs if pair[0] == '--params-file' and os.path.exists(pair[1])]
    for name in (
        'play',
        'twist',
        'controller',
        'policy',
        'policy_config',
        'description',
        'preset',
        'world',
        'map',
        'keepout',
    ):
        path = getattr(arguments, name, None)
        if name == 'map' and options.continues:
            continue  # it may take the place of what it goes on with
        if not isinstance(path, str):
            continue
        files = [path]
        if name in ('world', 'map', 'keepout'):
            # Here, because --help does without pictures.
            from wasd_core.map_picture import files_of

            files = files_of(path)
        word = f'--{name.replace("_", "-")}'
        inputs += [(word, file) for file in files if os.path.exists(file)]
    check_apart([output for output in outputs if output is not None], inputs)
