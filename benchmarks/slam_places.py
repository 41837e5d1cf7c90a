# SPDX-License-Identifier: Apache-2.0
"""Mapping as users have it: a lidar that is sold, worn tyres, places with little to hold on to."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from cores import all_on_cores
import numpy as np
from slam_logs import A1, Log, log_way
from slam_worlds import WORLDS
from table import Row

FIRST_SEED = 1000  # tuned on 10 to 30
ODOMETRY, LENGTH = '3 %', 110.0  # of the way [m]
# Of the median of the errors of trajectories [mm], and of the occupied cells that are right [%].
MOST = {'flat': 20.0, 'corridor': 100.0, 'round room': 100.0, 'block': 60.0, 'table legs': 30.0}
LEAST_RIGHT = 98.0
SENSOR = 'A1 that turns, noise of 1 %, 1 % of rays lost; odometry 3 % off'
MapOnce = Callable[[Log, Any, int], tuple[dict[str, Any], Any]]


def measure_places(
    map_once: MapOnce, seeds: Sequence[int], note: Callable[[str], None]
) -> list[Row]:
    """Return the rows of each place, which say with what sensor."""
    rows = []
    for name in WORLDS:
        note(f'slam: {name}, A1')
        rows += _rows(name, all_on_cores(partial(_map_place, map_once, name), seeds))
    return rows


def _map_place(map_once: MapOnce, name: str, seed: int) -> dict[str, Any]:
    make, drive = WORLDS[name]
    flat = make(seed)
    way = drive(flat, LENGTH, seed)
    log = log_way(way, flat.boxes, [ODOMETRY], seed, A1)[ODOMETRY]
    trial, _ = map_once(log, flat, seed)
    del trial['costs']
    return trial


def say_errors(trials: Sequence[dict[str, Any]]) -> str:
    """Return the errors of runs in words: as they are defined, and of poses as they are."""
    errors, unaligned = (
        1e3 * np.array([trial[key] for trial in trials]) for key in ('error', 'unaligned')
    )
    return (
        f'{np.median(errors):.1f} mm, {errors.max():.1f} at worst '
        f'(not aligned {np.median(unaligned):.1f}, {unaligned.max():.1f})'
    )


def _rows(name: str, trials: list[dict[str, Any]]) -> list[Row]:
    error = 1e3 * float(np.median([trial['error'] for trial in trials]))
    dead = 1e3 * float(np.median([trial['dead_reckoning'] for trial in trials]))
    right = float(np.median([trial['occupied_right'] for trial in trials]))
    rows = [
        Row(
            what=f'slam: {name}, ATE on {LENGTH:g} m, {SENSOR}',
            measured=f'{say_errors(trials)}, {len(trials)} runs',
            must=f'<= {MOST[name]:g} mm',
            passed=error <= MOST[name],
            anchor=f'dead reckoning {dead:.0f} mm; Karto: not run on rays that turn',
            trials=trials,
        )
    ]
    if name == 'flat':
        rows.append(
            Row(
                what=f'map: occupied cells right, {SENSOR}',
                measured=f'{right:.2f} %, {len(trials)} runs',
                must=f'>= {LEAST_RIGHT:g} %',
                passed=right >= LEAST_RIGHT,
            )
        )
    return rows
