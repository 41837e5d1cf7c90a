# SPDX-License-Identifier: Apache-2.0
"""Rows of the benchmark and how they are shown; intervals; what machine this is."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
import os
from pathlib import Path
import platform
from typing import Any

HEADINGS = ('what', 'measured', 'must', 'anchor it beats', '')
# Two-sided 95 % of the normal distribution, for Wilson's interval.
NORMAL_95 = 1.959964


@dataclass(frozen=True, kw_only=True)
class Row:
    """
    One claim: what was measured, what it must be, and each trial behind it.

    A trial says its seed and world where it has them, and its values.
    """

    what: str
    measured: str
    must: str
    passed: bool
    anchor: str = '-'
    trials: Sequence[dict[str, Any]] = ()


def at_most(
    what: str, values: float | Sequence[float], unit: str, limit: float, anchor: str = '-'
) -> Row:
    """Return a row that passes when the median of the values is not above a limit."""
    values = [values] if isinstance(values, float | int) else list(values)
    middle = sorted(values)[len(values) // 2]
    return Row(
        what=what,
        measured=f'{middle:.3g} {unit}'.strip(),
        must=f'<= {limit:g} {unit}'.strip(),
        passed=middle <= limit,
        anchor=anchor,
        trials=[{'value': value, 'unit': unit} for value in values],
    )


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate of success, by Wilson's score."""
    if trials == 0:
        return 0.0, 1.0
    z2 = NORMAL_95**2
    rate = successes / trials
    middle = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    spread = rate * (1 - rate) / trials + z2 / (4 * trials**2)
    half = NORMAL_95 * math.sqrt(spread) / (1 + z2 / trials)
    return max(0.0, middle - half), min(1.0, middle + half)


def format_count(successes: int, trials: int) -> str:
    """Return a count of successes with its interval: `10/10 (72-100 %)`."""
    low, high = wilson(successes, trials)
    return f'{successes}/{trials} ({100 * low:.0f}-{100 * high:.0f} %)'


def describe_machine() -> str:
    """Return the processor and the number of cores this process may use."""
    model = platform.processor() or platform.machine()
    for line in Path('/proc/cpuinfo').read_text().splitlines():
        if line.startswith('model name'):
            model = line.split(':', 1)[1].strip()
            break
    return f'{model}, {len(os.sched_getaffinity(0))} cores, Python {platform.python_version()}'


def format_table(rows: Sequence[Row]) -> str:
    """Return the rows as a table that Markdown renders and a terminal shows."""
    cells = [HEADINGS] + [
        (row.what, row.measured, row.must, row.anchor, 'ok' if row.passed else 'FAIL')
        for row in rows
    ]
    widths = [max(len(line[column]) for line in cells) for column in range(len(HEADINGS))]
    lines = [
        '| '
        + ' | '.join(f'{cell:{width}}' for cell, width in zip(line, widths, strict=True))
        + ' |'
        for line in cells
    ]
    rule = '|' + '|'.join('-' * (width + 2) for width in widths) + '|'
    return '\n'.join([lines[0], rule, *lines[1:]])
