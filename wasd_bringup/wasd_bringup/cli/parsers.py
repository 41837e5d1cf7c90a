# SPDX-License-Identifier: Apache-2.0
"""The words of the command line: the options of every command, and what --help tells."""

import argparse
from collections.abc import Sequence
import os
from typing import Any

from robot_description import describe_command
from wasd_bringup.cli.options import MOST_PORT, VIEWERS
from wasd_bringup.robots import BOTH, MBOT, preset_help, ROBOTS, robots_of
from wasd_bringup.run.inputs import KEY_LINE, SWITCH_LINE

# Nobody publishes more often by hand [Hz].
FASTEST = 10_000.0
Examples = tuple[tuple[str, str], ...]

# One wheel holds all packages; in a ROS workspace each is by itself.
DISTRIBUTIONS = ('wasd-robots', 'wasd_bringup')
EXAMPLES = (
    ('go2', 'stand, trot and walk a Unitree Go2'),
    ('mbot --preset wasd', 'drive a small wheeled robot'),
    ('demo go2', 'watch a scripted Go2 on a page'),
)
BOTH_EXAMPLES = (
    ('both', 'TAB selects the other robot'),
    ('both --world room', 'in a room'),
    ('both --record run.mcap', 'record; wasd replay run.mcap shows it'),
)
ROS = '--ros-args ... goes to the nodes: -r __ns:=/robot1, -p name:=value'


def examples_of(command: str = '') -> Examples:
    """Return the examples of a command that runs robots, or of the whole: words, what they do."""
    if not command:
        return EXAMPLES
    return BOTH_EXAMPLES if command == BOTH else ROBOTS[command].examples


def called() -> str:
    """Return what the user types to run `wasd`, which the script of that name tells."""
    return os.environ.get('WASD_CALLED', 'wasd')


def split_ros_arguments(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words for us, and those for ROS: from --ros-args on."""
    start = list(words).index('--ros-args') if '--ros-args' in words else len(words)
    return list(words[:start]), list(words[start:])


def describe_examples(command: str = '') -> list[str]:
    """Return the examples of a command as lines."""
    rows = examples_of(command)
    width = max((len(words) for words, _ in rows), default=0)
    return ['examples:', *(f'  {called()} {words:{width}}  {what}' for words, what in rows)]


def run_epilog(command: str) -> str:
    """Return what stands below the options of a command that runs robots."""
    lines = describe_examples(command)
    for row in robots_of(command):
        lines += ['', f'keys of {row.name}, --preset {row.preset} (others: {called()} keys):']
        keys = (*row.kind.state_help, *preset_help(row.preset))
        lines += [f'  {line}' for line in keys if line]
    switch = [SWITCH_LINE] if command == BOTH else []
    lines += [f'  {line}' for line in (*switch, KEY_LINE)]
    return '\n'.join(lines if command == BOTH else [*lines, '', ROS])


class Version(argparse.Action):
    """Prints the version that is installed."""

    def __call__(self, parser: argparse.ArgumentParser, *rest: Any) -> None:
        """Say it, and end."""
        print(f'wasd {version()}')
        parser.exit()


def version() -> str:
    """Return the version that is installed."""
    # Here, because few ask: it takes 20 ms of each start.
    from importlib import metadata

    for name in DISTRIBUTIONS:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return 'of unknown version'


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_PORT:
        raise argparse.ArgumentTypeError(f'got {text!r}, wanted 0 to {MOST_PORT}')
    return int(text)


def _path(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("got '', wanted a file or a folder")
    return text


def add_replay_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of a replay."""
    parser.add_argument('file', type=_path, metavar='FILE.mcap', help='a file written by --record')
    parser.add_argument(
        '--drive',
        action='store_true',
        help='simulate again with the recorded commands and compare the paths',
    )
    parser.add_argument('--viewer', choices=VIEWERS, help='default: web on a terminal, else none')
    parser.add_argument('--port', type=_port, default=0, metavar='N', help='port of the page')
    parser.add_argument(
        '--speed',
        metavar='X',
        help='1: original speed, 0: as fast as possible (default 1; 0 if unseen)',
    )


def add_calibrate_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `wasd calibrate`."""
    parser.add_argument(
        '--description',
        type=_path,
        default=MBOT.description,
        metavar='PATH',
        help='your own xacro or URDF',
    )
    parser.add_argument(
        '--package-path',
        type=_path,
        action='append',
        default=[],
        metavar='DIR',
        help='folder that package:// and $(find) search first (repeatable)',
    )
    parser.add_argument(
        '--controller',
        type=_path,
        metavar='FILE',
        help="YAML with the drive's parameters to calibrate",
    )
    parser.add_argument(
        '--wheel-separation', type=float, metavar='M', help="the controller's value"
    )
    parser.add_argument('--left-radius', type=float, metavar='M', help="the controller's value")
    parser.add_argument('--right-radius', type=float, metavar='M', help="the controller's value")
    parser.add_argument(
        '--side', type=float, default=1.0, metavar='M', help='side of the squares (default 1)'
    )
    parser.add_argument(
        '--runs', type=int, default=3, metavar='N', help='squares each way (default 3)'
    )
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='seed of their speeds')
    parser.add_argument(
        '--output', type=_path, metavar='FILE', help='YAML to write, for --controller'
    )


def add_describe_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `wasd describe`."""
    kinds = ('policy', *describe_command.COMMANDS)
    parser.add_argument(
        'kind',
        choices=kinds,
        help='policy: a network; for the other kinds see describe info --help',
    )
    parser.add_argument(
        'path', type=_path, metavar='FILE', help='an ONNX or TorchScript file, or ours'
    )
    parser.add_argument(
        '--policy-config',
        type=_path,
        metavar='FILE',
        help='settings of its training, if FILE has none',
    )
    parser.add_argument('--no-trial', action='store_true', help='only read it, do not walk')


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'got {text!r}, wanted a whole number >= 1')
    return int(text)


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= FASTEST:
        raise argparse.ArgumentTypeError(f'got {text!r}, wanted a number > 0 and <= {FASTEST:g}')
    return value


def add_graph_commands(commands: Any) -> None:
    """Declare `topics`, `echo`, `hz`, `pub`, `call` and `params`."""
    topics = _add(commands, 'topics', 'list the topics of all running nodes')
    topics.add_argument('-t', '--show-types', action='store_true', help='show their types, too')
    echo = _add(commands, 'echo', 'print the messages of a topic')
    echo.add_argument('topic', metavar='TOPIC')
    echo.add_argument(
        'type', nargs='?', metavar='TYPE', help='e.g. std_msgs/msg/String: wait for the topic'
    )
    echo.add_argument('--once', action='store_true', help='print one message and exit')
    echo.add_argument(
        '--field', metavar='PATH', help='print only this field, e.g. pose.pose.position'
    )
    echo.add_argument('-f', '--full-length', action='store_true', help='do not cut long arrays')
    hz = _add(commands, 'hz', 'print the rate of messages on a topic')
    hz.add_argument('topic', metavar='TOPIC')
    hz.add_argument(
        '-w', '--window', type=_count, default=10000, metavar='N', help='over the last N messages'
    )
    pub = _add(commands, 'pub', 'publish messages on a topic')
    pub.add_argument('topic', metavar='TOPIC')
    pub.add_argument(
        'rest',
        nargs='*',
        metavar='[TYPE] [VALUES]',
        help='type (default: that of the topic) and fields, e.g. "{linear: {x: 0.3}}"',
    )
    pub.add_argument(
        '-r', '--rate', type=_rate, default=1.0, metavar='HZ', help='messages a second (default 1)'
    )
    times = pub.add_mutually_exclusive_group()
    times.add_argument(
        '-1',
        '--once',
        dest='times',
        action='store_const',
        const=1,
        help='publish one message, then exit',
    )
    times.add_argument(
        '-t',
        '--times',
        type=_count,
        metavar='N',
        help='wait for a subscriber, publish N messages, then exit',
    )
    call = _add(commands, 'call', 'call a service')
    call.add_argument('service', metavar='SERVICE')
    call.add_argument(
        'rest',
        nargs='*',
        metavar='[TYPE] [YAML]',
        help='type (default: that of the service) and request, e.g. "{data: true}"',
    )
    params = _add(commands, 'params', "list, get or set a node's parameters")
    params.add_argument('node', metavar='NODE')
    params.add_argument('name', nargs='?', metavar='NAME', help='print its value')
    params.add_argument('value', nargs='?', metavar='VALUE', help='... or set it')


def _add(commands: Any, name: str, summary: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=summary, allow_abbrev=False)
    parser.set_defaults(looks_into_graph=True)
    return parser
