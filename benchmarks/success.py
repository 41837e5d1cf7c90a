# SPDX-License-Identifier: Apache-2.0
"""A picture of how often the Go2 stays up: over pushes, steps, slopes and friction."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from chart import Axes, GREY, Sheet
from cores import simulate_all
from go2_trouble import GAIT_PERIOD, PUSH_LASTS
import numpy as np
from table import wilson
from trials import Run, RunFailed, START, Trace

RATE = (32, 104, 196)
PUSHED = START + 1.5  # [s]
SPEED = 0.5  # [m/s]
AFTER = 3.0  # a robot that is up so long after a push has not fallen of it [s]
SLOPE_FRICTION = 0.8


class Panel(NamedTuple):
    """What is made harder and harder, one run of a size and a seed, and what it has to reach."""

    title: str
    unit: str
    sizes: Sequence[float]
    run: Callable[[float, int, int], Run]  # of a size, the number of the seed, and of how many
    way: float = 0.0  # [m]


def push(size: float, index: int, count: int) -> Run:
    """Push to the left, each seed in another part of the gait."""
    time = PUSHED + GAIT_PERIOD * index / count
    return Run(
        seed=index,
        twist=f'{START} {SPEED} 0 0\n',
        push=f'{time:.6f} 0 {size / PUSH_LASTS} 0 {PUSH_LASTS}',
        duration=PUSHED + GAIT_PERIOD + AFTER,
    )


def on(world: str, friction: float | None = None) -> Callable[[float, int, int], Run]:
    """Return what walks over a kind of ground."""

    def run(size: float, index: int, _: int) -> Run:
        return Run(
            seed=index,
            twist=f'{START} {SPEED} 0 0\n',
            duration=START + 7.0,
            world=f'{world}:{size:g}',
            friction=friction,
        )

    return run


def slip(size: float, index: int, _: int) -> Run:
    """Walk with feet of a friction."""
    return Run(seed=index, twist=f'{START} {SPEED} 0 0\n', duration=START + 7.0, friction=size)


PANELS = (
    Panel('lateral push at 0.5 m/s', 'N s', (20, 30, 40, 50, 60), push),
    Panel('one step, blind', 'cm', (0.04, 0.08, 0.12, 0.16, 0.2), on('step'), 2.5),
    Panel('uphill, friction 0.8', 'deg', (10, 15, 20, 25, 30), on('slope', SLOPE_FRICTION), 2.0),
    Panel('friction of the feet', '', (0.1, 0.2, 0.3, 0.4, 0.6), slip, 1.0),
)


def draw_success(path: Path, first_seed: int, count: int, note: Callable[[str], None]) -> str:
    """Run `count` seeds of each size, draw their shares of success, and return them in words."""
    runs = {
        (panel, size): [
            replace(run, seed=first_seed + run.seed)
            for run in (panel.run(size, index, count) for index in range(count))
        ]
        for panel in PANELS
        for size in panel.sizes
    }
    results = simulate_all([run for some in runs.values() for run in some], note)
    sheet, lines = Sheet(1200, 330), []
    for index, panel in enumerate(PANELS):
        counts = [
            sum(came_through(results[run], panel.way) for run in runs[panel, size])
            for size in panel.sizes
        ]
        _draw(sheet, index, panel, counts, count)
        shares = zip(panel.sizes, counts, strict=True)
        lines.append(f'{panel.title}: {", ".join(f"{at:g}: {n}/{count}" for at, n in shares)}')
    sheet.save(path)
    return '\n'.join(lines)


def came_through(result: Trace | RunFailed, way: float) -> bool:
    """Whether a robot has not fallen, and come so far [m]."""
    if isinstance(result, RunFailed):
        return False
    return result.is_up and float(result.position[-1, 0]) >= way


def _draw(sheet: Sheet, index: int, panel: Panel, counts: Sequence[int], of: int) -> None:
    left = 60 + 290 * index
    scale = 100.0 if panel.unit == 'cm' else 1.0
    sizes = scale * np.array(panel.sizes, dtype=float)
    margin = 0.12 * float(np.ptp(sizes))
    span = (float(sizes[0]) - margin, float(sizes[-1]) + margin)
    axes = Axes(sheet, (left, 50, left + 240, 260), span, (-4.0, 104.0))
    axes.grid(sizes.tolist(), [0, 25, 50, 75, 100])
    axes.name(panel.title, panel.unit, '')
    for size, count in zip(sizes.tolist(), counts, strict=True):
        low, high = wilson(count, of)
        axes.line(np.array([[size, 100 * low], [size, 100 * high]]), GREY, 7.0)
    shares = 100.0 * np.array(counts) / of
    axes.line(np.column_stack((sizes, shares)), RATE, 2.0)
    for size, share in zip(sizes.tolist(), shares.tolist(), strict=True):
        axes.dot((size, share), RATE, 4.0)
    if index == 0:
        words = f'share of runs that come through without a fall [%], {of} each; grey: Wilson 95 %'
        sheet.text((60, 310), words, 12)
