# SPDX-License-Identifier: Apache-2.0
"""
The benchmark: prints one table, writes JSON with a record of every trial.

Exit status 1 when a bound is missed.
"""

import argparse
import datetime
import json
import os
from pathlib import Path
import sys
import time

import go2
import mbot
from table import describe_machine
from table import format_table
import teleop

PARTS = {'mbot': mbot.measure, 'go2': go2.measure, 'teleop': teleop.measure}


def note(text: str) -> None:
    """Say how far it is, where somebody watches."""
    if sys.stderr.isatty():
        print(f'\r\033[K{text}', end='', file=sys.stderr, flush=True)


def main() -> int:
    """Run the benchmark of one part or of all."""
    parser = argparse.ArgumentParser(prog='wasd bench', description=__doc__)
    parser.add_argument('part', nargs='?', choices=list(PARTS), help='default: all')
    parser.add_argument('--json', default='wasd_bench.json', metavar='FILE', help='what to write')
    parser.add_argument('--quick', action='store_true', help='fewer seeds: at most 5 minutes')
    arguments = parser.parse_args()
    # Runs go side by side, perhaps beside somebody's robot: none is to hear another's cmd_vel.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    begin = time.monotonic()
    names = [arguments.part] if arguments.part else list(PARTS)
    try:
        rows = [row for name in names for row in PARTS[name](arguments.quick, note)]
    except KeyboardInterrupt:
        return 130
    finally:
        note('')
    took = time.monotonic() - begin
    date, machine = datetime.date.today().isoformat(), describe_machine()
    how = 'wasd bench --quick' if arguments.quick else 'wasd bench'
    print(format_table(rows, f'{how}, {date}, {machine}, {took / 60.0:.1f} minutes'))
    result = {
        'date': date,
        'machine': machine,
        'quick': arguments.quick,
        'seconds': round(took, 1),
        'rows': [vars(row) for row in rows],
    }
    Path(arguments.json).write_text(json.dumps(result, indent=1) + '\n')
    return 0 if all(row.passed for row in rows) else 1


if __name__ == '__main__':
    sys.exit(main())
