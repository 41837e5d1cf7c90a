# SPDX-License-Identifier: Apache-2.0
"""Benchmark of the heights that a Go2 knows of stairs: see `seen_stairs` for what is compared."""

from collections.abc import Callable
from typing import Any

import numpy as np
from seen_stairs import BESIDE, look_at_stairs, Seen, WALK
from table import format_count, Row

FIRST_SEED = 5100
# Rises [m], and where the base is in the end [m]: before stairs, and on them where it climbs.
CASES = ((0.10, 0.35), (0.13, 0.35), (0.16, 0.35), (0.10, 1.4))
MOST_OFF, MOST_RMSE = 0.04, 0.015  # of an edge, and of heights [m]


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure edges and heights."""
    rows = []
    for rise, end in CASES:
        where = 'before' if end < 0.8 else 'on'
        note(f'elevation: {where} stairs of {100.0 * rise:.0f} cm')
        seeds = range(FIRST_SEED, FIRST_SEED + (2 if quick else 10))
        seen = [look_at_stairs(rise, seed, end) for seed in seeds]
        name = f'elevation {where} stairs of {100.0 * rise:.0f} cm, after {WALK:g} m'
        trials = [
            {'seed': seed, 'world': f'stairs:{rise:g}', **_record(one)}
            for seed, one in zip(seeds, seen, strict=True)
        ]
        rows += [_edges(name, seen, trials), _heights(name, seen, trials)]
    return rows


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
