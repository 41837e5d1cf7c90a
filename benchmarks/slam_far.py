# SPDX-License-Identifier: Apache-2.0
"""What mapping costs on a long way: the time of a scan, and how the map grows in memory."""

import gc
import sys
import types
from typing import Any

from mujoco_sim.flats import make_flat
import numpy as np
from slam_errors import error_of
from slam_logs import A1, drive, Log, log_way, take_in
from table import Row
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.se2 import compose, inverse

FIRST_SEED = 1700
# All of the flat has been seen after the first of these; the whole way is the second [m].
SEEN, LENGTH = 200.0, 2000.0
ODOMETRY = '3 %'
MOST_P99, LONGEST, GROWTH = 2.0, 30.0, 1.1  # [ms], [ms]
# Code is shared, and no part of a map.
_CODE = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.CodeType)


def size_of(thing: object) -> int:
    """Return how much memory a thing holds, with all that it refers to [bytes]."""
    seen: set[int] = set()
    waiting, total = [thing], 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, _CODE):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
        if isinstance(one, np.ndarray) and isinstance(one.base, np.ndarray | bytes):
            waiting.append(one.base)
        elif isinstance(one, np.ndarray) and not one.flags.owndata:
            total += one.nbytes  # its memory is that of compiled code
    return total


def map_far(seed: int) -> dict[str, Any]:
    """Map a flat on a long way; return what each scan took [ms], and how large the map was."""
    flat = make_flat(seed)
    poses = drive(flat, LENGTH, seed)
    log = log_way(poses, flat.boxes, [ODOMETRY], seed, A1)[ODOMETRY]
    return {'seed': seed, **map_log(log)}


def map_log(log: Log) -> dict[str, Any]:
    """Map a log; return what each scan took [ms], and how large the map was on the way."""
    mapper = Mapper()
    steps = np.hypot(*np.diff(log.truth[:, :2], axis=0, prepend=log.truth[:1, :2]).T)
    gone = np.cumsum(steps)
    first = int(np.searchsorted(gone, SEEN))
    costs, sizes, within = np.zeros(len(log.scans)), [], []
    # The collector would go through the whole log now and then, which no robot holds.
    gc.collect()
    gc.freeze()
    for row in range(len(log.scans)):
        costs[row] = take_in(mapper, log, row)
        place = mapper.reference
        within.append((place, compose(inverse(mapper.places[place]), mapper.pose)))
        if row == first:
            sizes.append(size_of(mapper))
    gc.unfreeze()
    sizes.append(size_of(mapper))
    final = np.array([compose(mapper.places[place], pose) for place, pose in within])
    return {
        'way': float(gone[-1]),
        'places': len(mapper.places),
        'error': error_of(final, log.truth),
        'sizes': sizes,
        'median': float(np.median(costs)),
        'p99': float(np.percentile(costs, 99)),
        'longest': float(costs.max()),
    }


def measure_far(count: int) -> Row:
    """Return the row of so many long ways, one after the other: it times them."""
    trials = [map_far(FIRST_SEED + index) for index in range(count)]
    worst = {
        key: max(trial[key] for trial in trials) for key in ('median', 'p99', 'longest', 'error')
    }
    growth = max(trial['sizes'][1] / trial['sizes'][0] for trial in trials)
    size = max(trial['sizes'][1] for trial in trials) / 1e6
    return Row(
        what=f'slam: {LENGTH / 1000.0:g} km in a flat, A1, 3 % off: CPU of a scan, memory',
        measured=f'median {worst["median"]:.2f}, p99 {worst["p99"]:.2f}, longest '
        f'{worst["longest"]:.1f} ms; {size:.1f} MB, {growth:.2f} of those after {SEEN:g} m; '
        f'pose {1e3 * worst["error"]:.0f} mm off; all at worst of {count}',
        must=f'p99 <= {MOST_P99:g}, none > {LONGEST:g} ms, memory <= {GROWTH:g} of it',
        passed=worst['p99'] <= MOST_P99 and worst['longest'] <= LONGEST and growth <= GROWTH,
        trials=trials,
    )
