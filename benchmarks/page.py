# SPDX-License-Identifier: Apache-2.0
"""The page of numbers, docs/numbers.md, made of what a run of the benchmark has written."""

import json
from pathlib import Path
import re
from typing import Any

from table import format_table
from table import Row

# Drawn by `wasd bench legs --picture`, shown once it is there.
SUCCESS = 'pictures/go2_success.png'
DOCS = Path(__file__).resolve().parents[1] / 'docs'
RESULT, PAGE = DOCS / 'numbers.json', DOCS / 'numbers.md'

HEAD = """# Numbers

This is what `./{command}` printed at version {version} ({date}, {machine}, {minutes:.1f} minutes);
`./wasd bench --write` writes it. In brackets behind a count is its Wilson 95 % interval.
`./wasd bench` runs more seeds than `--quick`, and more robots.{note}

"""
FOOT = """

Odometry is compared with the physics' own truth. The Go2 has sensor noise, a command delay of 2 ms
and motors whose torque falls with speed, unless `--estimator truth` says otherwise; the papers
behind it are in [references](references.md).

![One gait period of the Go2's trot](pictures/go2_trot_strip.png)

![mbot's square: command, odometry and truth](pictures/mbot_square.png)
"""


def last_result() -> dict[str, Any]:
    """Return what the page on disk is made of."""
    result: dict[str, Any] = json.loads(RESULT.read_text())
    return result


def page(result: dict[str, Any]) -> str:
    """Return the page of a result."""
    head = HEAD.format(
        command=command(result),
        version=result['version'],
        date=result['date'],
        machine=result['machine'],
        minutes=result['seconds'] / 60.0,
        note=f'\n{result["note"]}' if 'note' in result else '',
    )
    table = format_table([Row(**row) for row in result['rows']])
    # Without the blanks that align it: a figure that changes changes one line.
    rows = re.sub('-{3,}', '---', re.sub(r' +\|', ' |', table))
    picture = f'\n![How often the Go2 comes through what is made harder]({SUCCESS})\n'
    return head + rows + FOOT + picture * (DOCS / SUCCESS).exists()


def command(result: dict[str, Any]) -> str:
    """Return the command that has measured a result."""
    return 'wasd bench --quick' if result['quick'] else 'wasd bench'


def duration_of_last_result() -> str:
    """Return how long the result on disk took to measure, in brackets; nothing without one."""
    try:
        return f' ({duration(last_result())})'
    except (OSError, ValueError, LookupError):
        return ''


def duration(result: dict[str, Any]) -> str:
    """Return how long a result took to measure, for a help."""
    minutes = max(1, round(result['seconds'] / 60.0))
    return f'{command(result)} took {minutes} minutes on {result["machine"]}'


def write(result: dict[str, Any]) -> None:
    """Write the page, and beside it the result without its trials."""
    rows = [{key: row[key] for key in row if key != 'trials'} for row in result['rows']]
    kept = {**result, 'rows': rows}
    RESULT.write_text(json.dumps(kept, indent=1) + '\n')
    PAGE.write_text(page(kept))
