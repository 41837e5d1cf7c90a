# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of what a Go2's lidar of points tells: heights of stairs, and the walls of a room.

See `seen_stairs` and `seen_room` for what is compared.
"""

from collections.abc import Callable
from typing import Any

from cores import each_on_cores
import numpy as np
from seen_room import look_around
from seen_stairs import BESIDE, look_at_stairs, Seen, WALK
from table import format_count, Row

FIRST_SEED = 5100
# Rises [m], and where the base is in the end [m]: before stairs, and on them where it climbs.
CASES = ((0.10, 0.35), (0.13, 0.35), (0.16, 0.35), (0.10, 1.4))
MOST_OFF, MOST_RMSE = 0.04, 0.015  # of an edge, and of heights [m]
# Of points from walls, and of the mean of a wall at 3 m [m].
MOST_FROM_WALLS, MOST_MEAN = 0.03, 0.01


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure edges and heights, then points of a room."""
    seeds = range(FIRST_SEED, FIRST_SEED + (2 if quick else 10))
    tasks = [(rise, end, seed) for rise, end in CASES for seed in seeds]
    found = {}
    for task, seen in each_on_cores(_look, tasks):
        found[task] = seen
        note(f'elevation: {len(found)} of {len(tasks)} walks')
    rows = []
    for rise, end in CASES:
        where = 'before' if end < 0.8 else 'on'
        seen_now = [found[rise, end, seed] for seed in seeds]
        name = f'elevation {where} stairs of {100.0 * rise:.0f} cm, after {WALK:g} m'
        trials = [
            {'seed': seed, 'world': f'stairs:{rise:g}', **_record(one)}
            for seed, one in zip(seeds, seen_now, strict=True)
        ]
        rows += [_edges(name, seen_now, trials), _heights(name, seen_now, trials)]
    note('elevation: walls of a room')
    return [*rows, *_walls([*range(FIRST_SEED, FIRST_SEED + (2 if quick else 20))])]


def _look(task: tuple[float, float, int]) -> Seen:
    rise, end, seed = task
    return look_at_stairs(rise, seed, end)


def _walls(seeds: list[int]) -> list[Row]:
    trials: list[dict[str, Any]] = [
        {
            'seed': seed,
            'world': 'room',
            'rms': float(np.sqrt(np.mean(seen.corrected**2))),
            'rms_uncorrected': float(np.sqrt(np.mean(seen.uncorrected**2))),
            'mean_at_wall': float(seen.at_wall.mean()),
            'clouds': seen.clouds,
        }
        for seed, seen in each_on_cores(look_around, seeds)
    ]
    rms, without = (max(t[key] for t in trials) for key in ('rms', 'rms_uncorrected'))
    mean = max(abs(t['mean_at_wall']) for t in trials)
    return [
        Row(
            what='cloud of a Go2 that trots and turns in a room, corrected: RMS to walls',
            measured=f'{100.0 * rms:.1f} cm at worst of {len(trials)}; '
            f'uncorrected {100.0 * without:.1f} cm',
            must=f'<= {100.0 * MOST_FROM_WALLS:g} cm',
            passed=rms <= MOST_FROM_WALLS,
            trials=trials,
        ),
        Row(
            what='cloud of a Go2 that stands, a wall at 3 m: mean error of its ranges',
            measured=f'{1e3 * mean:.1f} mm at worst of {len(trials)}',
            must=f'<= {1e3 * MOST_MEAN:g} mm',
            passed=mean <= MOST_MEAN,
            trials=trials,
        ),
    ]


def _record(seen: Seen) -> dict[str, Any]:
    return {
        'edges': {f'{edge:.2f}': errors.tolist() for edge, errors in seen.edges.items()},
        'rmse': seen.rmse,
        'rmse_everywhere': seen.rmse_everywhere,
        'known': seen.known,
        'state': seen.state,
    }


def _edges(name: str, seen: list[Seen], trials: list[dict[str, Any]]) -> Row:
    rows = [errors for one in seen for errors in one.edges.values()]
    middles = np.abs([np.median(errors) for errors in rows])
    each = np.abs(np.concatenate(rows))
    good = int((middles <= MOST_OFF).sum())
    return Row(
        what=f"{name}: a step's edge, the median of its rows of cells",
        measured=f'{format_count(good, len(middles))}, {100.0 * middles.max():.1f} cm at worst; '
        f'of single rows {100.0 * np.mean(each <= MOST_OFF):.0f} %, '
        f'95 % within {100.0 * np.percentile(each, 95):.1f} cm',
        must=f'<= {100.0 * MOST_OFF:g} cm',
        passed=good == len(middles) and all(one.edges for one in seen),
        trials=trials,
    )


def _heights(name: str, seen: list[Seen], trials: list[dict[str, Any]]) -> Row:
    rmse = [one.rmse for one in seen]
    everywhere = max(one.rmse_everywhere for one in seen)
    known = min(one.known for one in seen)
    return Row(
        what=f'{name}: RMSE of known heights {100.0 * BESIDE:g} cm and more from edges',
        measured=f'{100.0 * max(rmse):.2f} cm at worst of {len(seen)}; with edges '
        f'{100.0 * everywhere:.2f} cm; {100.0 * known:.0f} % of 4 x 4 m known',
        must=f'<= {100.0 * MOST_RMSE:g} cm',
        passed=max(rmse) <= MOST_RMSE,
        trials=trials,
    )
