# SPDX-License-Identifier: Apache-2.0
"""
The benchmark: prints one table, writes JSON with a record of every trial.

Exit status 1 when a bound is missed.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import datetime
import importlib.util
import json
import multiprocessing
from pathlib import Path
import sys
import tempfile
import time
import traceback

import both
import cockpit
import cores
import cycles
import describe
import elevation
from experiment import FIRST_SEED
import explore
from family import end_with_parent
import go2
import goals
import guard
import legs
import mbot
from mbot_accuracy import simulate, SQUARE
from mbot_picture import draw_square
import page
import people
import policies
from policy_player.policy_file import read_policy
import quadrupeds
import sight
import slam
import soak
import stair_goals
import stops
from success import draw_success
from table import describe_machine, format_table, Row
import teleop
from wasd_bringup.cli.parsers import version
from wasd_core.command_line import OneLineParser
from wasd_core.errors import UserError
from wasd_core.extras import install_line
from wasd_core.output_file import OutputFile
from wasd_core.streams import print_error

PARTS = {
    'mbot': mbot.measure,
    'go2': go2.measure,
    'legs': legs.measure,
    'both': both.measure,
    'page': cockpit.measure,
    'teleop': teleop.measure,
    'describe': describe.measure,
    'quadrupeds': quadrupeds.measure,
    'slam': slam.measure,
    'soak': soak.measure,
    'stops': stops.measure,
    'cycles': cycles.measure,
    'elevation': elevation.measure,
    'explore': explore.measure,
    'goals': goals.measure,
    'guard': guard.measure,
    'people': people.measure,
    'sight': sight.measure,
    'stairs': stair_goals.measure,
    'policy': policies.measure,
}


def note(text: str) -> None:
    """Say how far it is, where somebody watches."""
    if sys.stderr.isatty():
        print(f'\r\033[K{text}', end='', file=sys.stderr, flush=True)


def measure(name: str, arguments: argparse.Namespace) -> list[Row]:
    """
    Measure one part in a process of its own: whatever it sets, no other part inherits.

    One that breaks is a row that fails: the others have taken minutes.
    """
    spawning = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(
        max_workers=1, mp_context=spawning, initializer=end_with_parent
    ) as pool:
        try:
            return pool.submit(_measure_here, name, arguments).result()
        except Exception as error:
            traceback.print_exception(error)
            return [Row(what=name, measured=f'broke: {error}', must='runs', passed=False)]


def _measure_here(name: str, arguments: argparse.Namespace) -> list[Row]:
    quadrupeds.more += arguments.description
    legs.only += arguments.only
    sight.only += arguments.only
    cores.cluster = arguments.dask
    policies.chosen = arguments.file or policies.chosen
    return PARTS[name](arguments.quick, note)


def draw(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    """Draw mbot's square, or when the Go2 falls, and return the exit status."""
    path = Path(arguments.picture)
    if arguments.part not in (None, 'mbot', 'legs'):
        parser.error(f'--picture is of mbot or legs, not of {arguments.part}')
    if path.suffix != '.png' or not path.absolute().parent.is_dir():
        parser.error(f'--picture {path}: wanted a .png in a folder that exists')
    if arguments.part == 'legs':
        print(draw_legs(path, arguments))
    else:
        with tempfile.TemporaryDirectory() as folder:
            draw_square(simulate(Path(folder), '--twist', SQUARE, 29.0), path)
    print(f'drawn to {path}')
    return 0


def draw_legs(path: Path, arguments: argparse.Namespace) -> str:
    """Draw how often the Go2 comes through, and return it in words."""
    cores.cluster = arguments.dask
    return draw_success(path, FIRST_SEED, 4 if arguments.quick else 20, note)


def make_parser() -> argparse.ArgumentParser:
    """Return what reads the command line."""
    parser = OneLineParser(prog='wasd bench', description=__doc__)
    parser.add_argument('part', nargs='?', choices=list(PARTS), help='default: all')
    parser.add_argument(
        'file', nargs='*', metavar='FILE', help='of policy: the network [and its configuration]'
    )
    parser.add_argument('--json', default='wasd_bench.json', metavar='FILE', help='what to write')
    parser.add_argument(
        '--quick', action='store_true', help=f'fewer seeds{page.duration_of_last_result()}'
    )
    parser.add_argument(
        '--write',
        action='store_true',
        help='write docs/numbers.md, and docs/numbers.json; of one part, or --only, its rows '
        'alone; with all legs, but --quick, also the picture of when the Go2 falls',
    )
    parser.add_argument(
        '--description',
        action='append',
        default=[],
        metavar='FILE',
        help='another robot to walk with the quadrupeds (repeatable)',
    )
    parser.add_argument(
        '--only',
        action='append',
        default=[],
        metavar='TEXT',
        help='of legs or sight, the rows whose names contain this (repeatable)',
    )
    parser.add_argument(
        '--dask',
        default='',
        metavar='ADDRESS',
        help="simulate on a Dask cluster, e.g. tcp://10.0.0.1:8786 (needs wasd's extra `cluster`)",
    )
    parser.add_argument(
        '--picture',
        metavar='FILE',
        help="draw mbot's square as a PNG, or with legs when the Go2 falls, and measure nothing",
    )
    return parser


def main() -> int:
    """Run the benchmark of one part or of all; return the exit status."""
    try:
        return run(make_parser())
    except UserError as error:
        print_error(error)
        return 2


def run(parser: argparse.ArgumentParser) -> int:
    """
    Run what the command line asks for; return the exit status.

    Raises:
        UserError: an option is wrong; the text says how, in one line.
    """
    arguments = parser.parse_args()
    if arguments.picture is not None:
        return draw(parser, arguments)
    if arguments.description and arguments.part not in (None, 'quadrupeds'):
        parser.error(f'--description is of quadrupeds, not of {arguments.part}')
    for path in arguments.description:
        quadrupeds.scale_at(Path(path))
    if arguments.write and arguments.description:
        parser.error('--write is of our robots: leave out --description')
    if arguments.file and (arguments.part != 'policy' or len(arguments.file) > 2):
        parser.error('FILE [CONFIG] is of policy')
    if arguments.file:
        read_policy(*arguments.file)
    if arguments.file and arguments.write:
        parser.error('--write is of our policy: leave out FILE')
    if arguments.only and arguments.part not in ('legs', 'sight'):
        parser.error('--only is of legs and of sight')
    for text in arguments.only:
        is_legs = arguments.part == 'legs'
        if not (legs.experiments(arguments.quick, text) if is_legs else sight.cases([text])):
            parser.error(f'--only {text!r}: no row of {arguments.part} has that in its name')
    if arguments.dask and importlib.util.find_spec('distributed') is None:
        parser.error(f'--dask needs: {install_line("cluster")}')
    output = OutputFile(Path(arguments.json), '--json')
    begin = time.monotonic()
    names = [arguments.part] if arguments.part else list(PARTS)
    try:
        parts = {name: measure(name, arguments) for name in names}
    except KeyboardInterrupt:
        return 130
    finally:
        note('')
    took = time.monotonic() - begin
    rows = [row for found in parts.values() for row in found]
    result = {
        'version': version(),
        'date': datetime.date.today().isoformat(),
        'machine': describe_machine(),
        'quick': arguments.quick,
        'seconds': round(took, 1),
        'rows': [{**vars(row), 'part': name} for name, found in parts.items() for row in found],
    }
    print(f'{page.command(result, arguments.part)}, {result["date"]}, {took / 60.0:.1f} minutes')
    print(result['machine'], format_table(rows), sep='\n\n')
    output.write(f'{json.dumps(result, indent=1)}\n'.encode())
    if arguments.write:
        keep = page.with_rows if arguments.only else page.with_part
        kept = result if arguments.part is None else keep(result, arguments.part)
        page.write(kept)  # what took so long, before what may be interrupted
        if 'legs' in names and not arguments.quick and not arguments.only:
            print(draw_legs(page.DOCS / page.SUCCESS, arguments))
            page.write(kept)  # with the picture, if it is the first
    return 0 if all(row.passed for row in rows) else 1


if __name__ == '__main__':
    sys.exit(main())
