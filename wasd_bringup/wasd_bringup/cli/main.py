# SPDX-License-Identifier: Apache-2.0
"""The `wasd` command."""

import argparse
from collections.abc import Sequence
import contextlib
import importlib.util
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import NoReturn

from teleop_keyboard.keymap import LAYOUTS
from teleop_keyboard.keymap_file import describe_keymap, list_presets
from teleop_keyboard.terminal import tolerate_any_text
from wasd_core.command_line import OneLineParser
from wasd_core.errors import Stopped, UserError
from wasd_core.loading import loading
from wasd_core.network import check_middleware
from wasd_core.shared_memory import look_before_ros
from wasd_core.streams import lost_output, OutputLost, prepare_streams, print_error

from robot_description import describe_command
from wasd_bringup.cli.options import add_run_options
from wasd_bringup.cli.parsers import (
    add_calibrate_options,
    add_describe_options,
    add_graph_commands,
    add_replay_options,
    called,
    describe_examples,
    run_epilog,
    split_ros_arguments,
    Version,
)
from wasd_bringup.robots import BOTH, ROBOTS, unitree_help, UNITREE_PRESET

# Tests wait more than they compute; a module's runs are shared by its tests.
WORKERS = (
    *('-n', 'auto', '--maxprocesses', '6', '--dist', 'loadfile', '--no-loadscope-reorder'),
    '--max-worker-restart=0',  # who replaces one would begin with the test that ended it
)
# How a file that describes a robot ends.
DESCRIPTIONS = ('.urdf', '.xacro', '.xml', '.sdf')
# Commands that take other words as they are, and know nothing of --help themselves.
HELPED = {
    'test': 'run the tests; --quick: those without processes; other words go to pytest',
    'lint': 'run the linters: ruff and mypy',
}
LINTERS = (('ruff', 'check', '.'), ('ruff', 'format', '--check', '.'), ('mypy',))


def make_parser(command: str | None = None) -> argparse.ArgumentParser:
    """
    Return the parser of the command line.

    Where a command is named, only its own options are in it: all of them take a while to add.
    """

    def is_asked(name: str) -> bool:
        return command in (None, name)

    parser = OneLineParser(
        prog=called(),
        description='Drive simulated robots from the keyboard.',
        epilog='\n'.join(
            [*describe_examples(), '', f'{called()} COMMAND --help has the options and the keys.']
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    what = "show program's version number and exit"
    parser.add_argument('--version', action=Version, nargs=0, help=what)
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    summaries = {row.name: row.summary for row in ROBOTS.values()}
    summaries[BOTH] = 'drive Go2 and mbot in one world; TAB selects the other robot'
    for name, summary in summaries.items():
        if is_asked(name):
            run = commands.add_parser(
                name,
                help=summary,
                description=f'{summary[0].upper()}{summary[1:]}.',
                epilog=run_epilog(name),
                formatter_class=argparse.RawDescriptionHelpFormatter,
                allow_abbrev=False,
            )
            add_run_options(run, name)
        else:
            commands.add_parser(name, help=summary)
    demo = commands.add_parser(
        'demo',
        help='go2: watch a scripted Go2 on the page; alone: a tour that writes pictures',
        allow_abbrev=False,
    )
    demo.add_argument(
        'watched',
        nargs='?',
        choices=('go2',),
        help='show it on the page, 45 s (default: the tour)',
    )
    demo.add_argument(
        '--output',
        default='wasd_demo',
        metavar='DIR',
        help='folder of the pictures (default: wasd_demo)',
    )
    demo.add_argument(
        '--only',
        default='',
        metavar='TEXT',
        help='visit the stops of the tour with this in their names (default: all)',
    )
    keys = commands.add_parser('keys', help='list keymaps, or print one', allow_abbrev=False)
    keys.add_argument('preset', nargs='?', metavar='NAME|FILE', help='a preset, or your YAML file')
    keys.add_argument('--layout', choices=LAYOUTS, default='qwerty', help='keyboard')
    calibrate = commands.add_parser(
        'calibrate', help="measure mbot's wheels by driving squares", allow_abbrev=False
    )
    if is_asked('calibrate'):
        add_calibrate_options(calibrate)
    describe = commands.add_parser(
        'describe',
        help='policy FILE: check a network and walk with it; info FILE, lint FILE: check a robot',
        epilog="info, lint, fix and expand work on a robot's file, like the program describe.",
        allow_abbrev=False,
    )
    add_describe_options(describe)
    replay = commands.add_parser(
        'replay', help='show a recording, or drive its commands again', allow_abbrev=False
    )
    add_replay_options(replay)
    add_graph_commands(commands)
    for name, summary in HELPED.items():
        commands.add_parser(name, help=summary, description=f'{summary[0].upper()}{summary[1:]}.')
    commands.add_parser('bench', help='run the benchmark: a table and JSON', add_help=False)
    return parser


def first_words() -> list[str]:
    """Return what `wasd` says when nothing is typed."""
    name = called()
    return [
        'wasd drives simulated robots from the keyboard, here and on a page in your browser.',
        f'  {name} demo go2    a Go2 shows its skills; {name} go2: you drive, ? shows the keys',
        f'  {name} --help      every command',
    ]


def print_keys(arguments: argparse.Namespace) -> int:
    """Print the presets, or one keymap; return the exit status."""
    if arguments.preset is None:
        unitree = f'{UNITREE_PRESET:14} states and sticks of the Go2'
        print(
            '\n'.join([*list_presets(), unitree, '', f'{called()} keys NAME prints one of them'])
        )
    elif arguments.preset == UNITREE_PRESET:
        print('\n'.join(unitree_help(arguments.layout)))
    else:
        keymap = describe_keymap(arguments.preset, arguments.layout, [UNITREE_PRESET])
        print('\n'.join(keymap))
    return 0


def _no_command(file: str) -> str:
    """Return the error for a robot's file in the place of a command."""
    name = called()
    return (
        f'{file} is a file, wanted a command: {name} go2 --description {file} walks it on four '
        f'legs, {name} mbot --description {file} drives it on two wheels, '
        f'{name} describe info {file} says what it is'
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    prepare_streams()
    tolerate_any_text()
    try:
        asks = words[1:] in (['-h'], ['--help']) and words[0] in HELPED
        if words and words[0] in CLONE_COMMANDS and not asks:
            return CLONE_COMMANDS[words[0]](words[1:])
        if words[:1] == ['describe'] and describe_command.is_command(words[1:]):
            return describe_command.main(words[1:])
        words, ros_arguments = split_ros_arguments(words)
        if words and Path(words[0]).suffix in DESCRIPTIONS:
            raise UserError(_no_command(words[0]))
        if not words:
            print('\n'.join(first_words()))
            return 0
        if tuple(words) == ('demo', 'go2'):
            words = ['go2', '--play', str(DEMO), '--viewer', 'web']
        arguments = make_parser(words[0]).parse_args(words)
        arguments.words = (*words, *ros_arguments)
        # The commands whose nodes can be renamed, remapped and set: `-r __ns:=/robot`.
        if ros_arguments and arguments.command not in ROBOTS:
            takers = ', '.join(ROBOTS)
            raise UserError(f'{arguments.command} takes no --ros-args; {takers} do')
        return _act(arguments, ros_arguments)
    except UserError as error:
        print_error(error)
        return 2
    except OutputLost as error:
        return lost_output(error)
    except (KeyboardInterrupt, Stopped):
        return 130


def _act(arguments: argparse.Namespace, ros_arguments: Sequence[str]) -> int:
    """Do what was asked for: only now is loaded what that needs, so that --help comes at once."""
    if arguments.command == 'keys':
        return print_keys(arguments)
    if arguments.command == 'describe':
        from wasd_bringup.tools.describe_policy import describe_policy_command

        return describe_policy_command(arguments)
    if getattr(arguments, 'watched', None):
        raise UserError('demo go2 takes no other words: --only and --output are of the tour alone')
    check_middleware(os.environ)
    look_before_ros()
    from robot_description.mujoco import check_renderer, choose_renderer

    check_renderer()  # before mujoco is imported, as below
    if arguments.command == 'demo':
        choose_renderer()
        from wasd_bringup.cli.demo import demo_command

        return demo_command(arguments.output, arguments.only)
    if arguments.command == 'calibrate':
        from wasd_bringup.tools.calibrate import calibrate_command

        return calibrate_command(arguments)
    if arguments.command == 'replay':
        from wasd_bringup.tools.recording.replay import replay_command

        return replay_command(arguments)
    if 'looks_into_graph' in arguments:
        from wasd_bringup.tools.graph.commands import run_graph_command

        return run_graph_command(arguments)
    with contextlib.ExitStack() as start:
        start.enter_context(loading())
        from wasd_bringup.cli.run_command import run_command

        return run_command(arguments, ros_arguments, start.close)


def run_tests(arguments: Sequence[str]) -> NoReturn:
    """
    Become pytest on the clone's tests.

    `--quick` runs the tests that need no process, no ROS and no browser, in one process; other
    arguments go to pytest.

    Raises:
        UserError: this is not installed from a clone.
    """
    words = list(arguments)
    if '--quick' in words:
        words.remove('--quick')
        words = ['-m', 'not slow', '-q', *words]
    else:
        words = [*WORKERS, *words]
    os.chdir(_clone('tests'))
    _become('-m', 'pytest', *words)


def run_linters(arguments: Sequence[str]) -> int:
    """
    Run the linters on the clone, all of them; return 0 if all are content.

    Raises:
        UserError: this is not installed from a clone, or without its linters.
    """
    if arguments:
        raise UserError(f'lint takes no arguments, got {" ".join(arguments)}')
    missing = [words[0] for words in LINTERS if importlib.util.find_spec(words[0]) is None]
    if missing:
        raise UserError(
            f'{missing[0]} is not installed: {sys.executable} -m pip install -e '
            f"'{_clone('tests')}[lint]'"
        )
    # Ctrl-C is for both: the program that is started has the last word.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    programs = [[sys.executable, '-m', *words] for words in LINTERS]
    return max(subprocess.run(words, cwd=_clone('tests')).returncode for words in programs)


def run_benchmark(arguments: Sequence[str]) -> NoReturn:
    """
    Become the clone's benchmark, whose exit status is 1 when a bound is missed.

    Raises:
        UserError: this is not installed from a clone.
    """
    script = _clone('benchmarks') / 'benchmarks' / 'run.py'
    _become(str(script), *arguments)


def _become(*words: str) -> NoReturn:
    """Go on as another Python program: whatever ends this process ends that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, *words])


def _clone(folder: str) -> Path:
    root = Path(__file__).resolve().parents[3]
    if not (root / folder).is_dir():
        raise UserError(f'{folder}/ comes with a clone of the repository; none at {root}')
    return root


# What the Go2 does by itself in `wasd demo go2`.
DEMO = Path(__file__).with_name('demo_go2.keys')
CLONE_COMMANDS = {'test': run_tests, 'lint': run_linters, 'bench': run_benchmark}


if __name__ == '__main__':
    sys.exit(main())
