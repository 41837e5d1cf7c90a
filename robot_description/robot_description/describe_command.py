# SPDX-License-Identifier: Apache-2.0
"""The `describe` command: kind, contents and mistakes of a xacro or URDF file."""

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import re
import signal
import sys
from typing import Any

from wasd_core.command_line import OneLineParser
from wasd_core.errors import UserError
from wasd_core.output_file import identity, OutputFile
from wasd_core.streams import lost_output, OutputLost, prepare_streams, print_error

# What a xacro argument looks like on the command line.
ASSIGNMENT = ':='
# The option whose value looks the same.
RENAME = '--rename'
XACRO_ARG = '--xacro-arg'
# Codes of findings that `fix` can mend.
MENDABLE = (
    'unprefixed-macro',
    'repeated-material',
    'swapped-sides',
    'swapped-ends',
    'missing-footprint',
    'wrong-mesh-path',
)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = OneLineParser(
        prog='describe',
        description='Expand, check, mend and show robot descriptions (xacro or URDF).',
        epilog='Words like name:=value are xacro arguments.',
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for add in COMMANDS.values():
        add(commands)
    return parser


def _add(
    commands: 'argparse._SubParsersAction[OneLineParser]', name: str, text: str
) -> OneLineParser:
    parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    parser.add_argument('path', metavar='PATH', help='a xacro or URDF file, or go2, or mbot')
    text = 'folder that package:// and $(find) search first'
    _add_repeatable(parser, '--package-path', 'DIR', text, type=_folder)
    return parser


def _add_repeatable(
    parser: OneLineParser, option: str, metavar: str, text: str, **more: Any
) -> None:
    parser.add_argument(
        option, action='append', default=[], metavar=metavar, help=f'{text} (repeatable)', **more
    )


def _add_expand(commands: 'argparse._SubParsersAction[OneLineParser]') -> None:
    parser = _add(commands, 'expand', 'print the URDF of a xacro file')
    parser.add_argument('--output', type=Path, metavar='FILE', help='write to this file instead')
    parser.set_defaults(run=_expand)


def _add_lint(commands: 'argparse._SubParsersAction[OneLineParser]') -> None:
    parser = _add(commands, 'lint', 'list mistakes, their places and their cures')
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument('--strict', action='store_true', help='status 1 on warnings, too')
    _add_repeatable(parser, '--expect', 'JOINT', 'a joint name that a controller looks for')
    parser.set_defaults(run=_lint)


def _add_fix(commands: 'argparse._SubParsersAction[OneLineParser]') -> None:
    parser = _add(commands, 'fix', 'repair the file; prints a diff, writes nothing')
    text = 'rename a joint in all files'
    _add_repeatable(parser, '--rename', 'OLD:=NEW', text)
    text = f'mend only these: {", ".join(MENDABLE)}'
    _add_repeatable(parser, '--only', 'CODE', text, choices=MENDABLE)
    parser.add_argument(
        '--output', type=Path, metavar='PATH', help='a new file, or a folder for the whole package'
    )
    parser.set_defaults(run=_fix)


def _add_info(commands: 'argparse._SubParsersAction[OneLineParser]') -> None:
    parser = _add(commands, 'info', 'print the tree, masses, joints and meshes')
    parser.add_argument('--picture', type=Path, metavar='FILE.png', help='draw the robot, too')
    parser.add_argument('--json', action='store_true', help='print JSON')
    parser.add_argument(
        '--check',
        action='store_true',
        help='compare the links in MuJoCo, Pinocchio and yourdfpy, too',
    )
    parser.set_defaults(run=_info)


COMMANDS = {'expand': _add_expand, 'lint': _add_lint, 'fix': _add_fix, 'info': _add_info}


def is_command(words: Sequence[str]) -> bool:
    """Whether the first word that is no xacro argument is one of the commands."""
    return next((word for word in words if ASSIGNMENT not in word), '') in COMMANDS


def _folder(text: str) -> Path:
    from robot_description.packages import readable_folder

    try:
        return readable_folder(text)
    except UserError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _expand(options: argparse.Namespace) -> int:
    from robot_description.xacro.session import expand_document

    expansion = expand_document(options.path, options.arguments, options.package_path)
    for place, text in expansion.warnings:
        print(f'warning: {place or options.path}: {text}', file=sys.stderr)
    if options.output is None:
        sys.stdout.write(expansion.urdf)
    else:
        if identity(options.output) in {identity(file) for file in expansion.files}:
            raise UserError(f'--output {options.output}: is a source; it is not overwritten')
        data = expansion.urdf.encode(errors='backslashreplace')
        OutputFile(options.output, '--output').write(data)
    return 0


def _lint(options: argparse.Namespace) -> int:
    from robot_description.lint.rules import Severity
    from robot_description.lint.session import lint
    from robot_description.xacro.session import XacroSession

    session = XacroSession(options.path, options.arguments, options.package_path)
    found = lint(session, options.expect)
    if options.json:
        print(json.dumps([one.record() for one in found], indent=2))
    else:
        print('\n'.join(one.line() for one in found) or f'{options.path}: no findings')
    bad = {Severity.ERROR, Severity.WARNING} if options.strict else {Severity.ERROR}
    return int(any(one.rule.severity in bad for one in found))


def _fix(options: argparse.Namespace) -> int:
    from robot_description.fix.edits import read_renames
    from robot_description.fix.mending import lost_there, mend, write_mended

    renames = read_renames(options.rename)
    fixes = mend(options.path, options.arguments, options.package_path, renames, options.only)
    sys.stdout.write(fixes.diff())
    if fixes.mended:
        print(f'mended: {", ".join(fixes.mended)}', file=sys.stderr)
    for one in fixes.left:
        print(f'left: {one.line()}', file=sys.stderr)
    errors = [one for one in fixes.left if one.is_error]
    if options.output is not None:
        output = write_mended(fixes, options.path, options.output)
        print(f'written: {output}', file=sys.stderr)
        lost = lost_there(fixes, output, options.arguments, options.package_path)
        errors += lost
        for one in lost[:1]:
            print(
                f'left: what lies beside {options.path} is missing there: write to a file beside '
                f'it, or to a folder, which gets the whole package: {one.line()}',
                file=sys.stderr,
            )
    return int(bool(errors))


def _info(options: argparse.Namespace) -> int:
    if options.picture is not None:
        from robot_description.mujoco import choose_renderer

        choose_renderer()  # before mujoco is imported
    from robot_description.description import read_description
    from robot_description.info import info_record

    info = read_description(options.path, options.package_path, options.arguments)
    record = info_record(info)
    if options.check:
        from robot_description.info import check_kinematics

        deviations = check_kinematics(info)
        record['kinematics'] = [deviation._asdict() for deviation in deviations]
    if options.json:
        print(json.dumps(record, indent=2))
    else:
        from robot_description.info import print_info

        print_info(info)
        for library, distance, link in deviations if options.check else ():
            print(f'{library}: links within {distance:.1e} m of the description (worst: {link})')
    if options.picture is not None:
        from robot_description.mujoco.picture import draw

        draw(info.robot.with_stand_in_masses(), options.picture)
    return 0


def read_command_line(words: Sequence[str]) -> argparse.Namespace:
    """
    Return the options; `arguments` holds the xacro arguments, from wherever they stood.

    Raises:
        UserError: an option or word that is not known.
    """
    # They are taken out first: argparse would take one that stands before PATH for the path.
    assignments: list[str] = []
    rest: list[str] = []
    before = ''
    for word in words:
        is_assignment = re.match(r'[^\W\d]\w*:=', word) and before != RENAME
        if is_assignment and before == XACRO_ARG:  # the `wasd` command's way to write it
            rest.pop()
        (assignments if is_assignment else rest).append(word)
        before = word
    options = make_parser().parse_args(rest)
    options.arguments = dict(word.split(ASSIGNMENT, 1) for word in assignments)
    return options


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status: 0, 1 with findings, 2 for a mistake."""
    from robot_description.packages import description_path

    prepare_streams()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # URDF is UTF-8 whatever the terminal is; file names need not be text at all.
    sys.stdout.reconfigure(encoding='utf-8', errors='backslashreplace')  # type: ignore[union-attr]
    try:
        options = read_command_line(sys.argv[1:] if argv is None else argv)
        options.path = description_path(options.path)
        return int(options.run(options))
    except UserError as error:
        print_error(error)
        return 2
    except OutputLost as error:
        return lost_output(error)
    except KeyboardInterrupt:
        return 130


if __name__ == '__main__':
    sys.exit(main())
