# SPDX-License-Identifier: Apache-2.0
"""The page of numbers, docs/numbers.md, made of what a run of the benchmark has written."""

import json
from pathlib import Path
import re
from typing import Any

from table import format_table, Row

# Drawn by `wasd bench legs --write`, if not `--quick`, and by `wasd bench legs --picture`.
SUCCESS = 'pictures/go2_success.png'
DOCS = Path(__file__).resolve().parents[1] / 'docs'
RESULT, PAGE = DOCS / 'numbers.json', DOCS / 'numbers.md'

HEAD = """# Numbers

This is what `./{command}` printed at version {version} ({date}, {machine}, {minutes:.1f} minutes);
`./wasd bench --write` writes it. In brackets behind a count is its Wilson 95 % interval.
`./wasd bench` runs more seeds than `--quick`, and more robots.{alone}

"""
FOOT = """

Odometry is compared with the physics' own truth. The Go2 has a command delay of 2 ms and
motors whose torque falls with speed; with `--estimator truth` it has no sensor noise. The papers
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
        alone=''.join(_say_alone(name, found) for name, found in result.get('alone', {}).items())
        + _say_again(result.get('again', {})),
    )
    table = format_table([_as_row(row) for row in result['rows']])
    # Without the blanks that align it: a figure that changes changes one line.
    rows = re.sub('-{3,}', '---', re.sub(r' +\|', ' |', table))
    picture = f'\n![How often the Go2 comes through what is made harder]({SUCCESS})\n'
    return head + rows + FOOT + picture * (DOCS / SUCCESS).exists()


def _as_row(kept: dict[str, Any]) -> Row:
    return Row(**{key: kept[key] for key in kept if key != 'part'})


def _say_alone(name: str, found: dict[str, Any]) -> str:
    return (
        f'\nThe rows of {name} are of `./{command(found, name)}` alone (version '
        f'{found["version"]}, {found["date"]}, {found["machine"]}, '
        f'{found["seconds"] / 60.0:.1f} minutes).'
    )


def _say_again(again: dict[str, dict[str, Any]]) -> str:
    """Say who measured which rows again: facts by the row's name."""
    names: dict[str, list[str]] = {}
    for what, facts in again.items():
        where = f'version {facts["version"]}, {facts["date"]}, {facts["machine"]}'
        names.setdefault(f'`./{facts["command"]}` ({where})', []).append(what)
    return ''.join(f'\nOf {by} are: {"; ".join(found)}.' for by, found in names.items())


def with_rows(result: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the result on disk with some rows of one part measured, again or at last."""
    last = last_result()
    facts = {key: result[key] for key in ('version', 'date', 'machine')}
    facts['command'] = f'{command(result, name)} --only ...'
    measured = {row['what']: row for row in result['rows']}
    again = {**last.get('again', {}), **dict.fromkeys(measured, facts)}
    rows = [measured.pop(row['what'], row) if row['part'] == name else row for row in last['rows']]
    ends = [index + 1 for index, row in enumerate(rows) if row['part'] == name]
    at = max(ends, default=len(rows))
    return {**last, 'again': again, 'rows': rows[:at] + [*measured.values()] + rows[at:]}


def with_part(result: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the result on disk with the rows of one part measured again, in their place."""
    last = last_result()
    facts = {key: result[key] for key in ('version', 'date', 'machine', 'quick', 'seconds')}
    parts = [row['part'] for row in last['rows']]
    at = parts.index(name) if name in parts else len(parts)
    after = [row for row in last['rows'][at:] if row['part'] != name]
    others = {row['what'] for row in last['rows'] if row['part'] != name}
    again = {what: facts for what, facts in last.get('again', {}).items() if what in others}
    return {
        **last,
        'again': again,
        'alone': {**last.get('alone', {}), name: facts},
        'rows': last['rows'][:at] + result['rows'] + after,
    }


def command(result: dict[str, Any], part: str | None = None) -> str:
    """Return the command that has measured a result, of one part or of all."""
    words = ['wasd bench', part or '', '--quick' if result['quick'] else '']
    return ' '.join(word for word in words if word)


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
