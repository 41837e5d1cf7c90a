# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of mapping and localising: where the robot is, how true the map is, at what cost.

Flats and noise of seeds that nothing was tuned on; logs without physics, one of the real mbot.
"""

from collections.abc import Callable, Sequence
import math
from pathlib import Path
import tempfile
from typing import Any

from mujoco_sim.flats import Flat, make_flat
import numpy as np
from PIL import Image
from slam_anchor import map_by_karto, WHY_NOT
from slam_errors import error_of, trajectory_error
from slam_far import measure_far
from slam_localise import measure_localising
from slam_logs import GO2_LIDAR, Log, make_logs, surface_distance, take_in
from slam_physics import drive_mbot
from slam_places import measure_places, say_errors
from slam_sill import measure_sill
from slam_speed import measure_speed
from table import format_count, Row
from wasd_navigation.mapping import save_map
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.records import FREE, Grid, OCCUPIED
from wasd_navigation.se2 import compose, inverse, wrap
import yaml

FIRST_SEED = 1000
LENGTH = 110.0  # of the way [m]
LOST = 0.5  # error of a run that is lost [m]
# Of the absolute trajectory error in the end: median, worst [m].
BOUNDS = {'mbot': (0.003, 0.02), 'go2': (0.003, 0.04), 'poor': (0.03, LOST)}
IN_PHYSICS = (0.02, 0.02)  # the same of mbot's own wheels and lidar
WORDS = {'mbot': "mbot's odometry", 'go2': 'Go2-like (1 %)', 'poor': 'poor (5 %)'}


def follow(mapper: Mapper | Localizer, log: Log, rows: range) -> np.ndarray:
    """Take in the scans of a log, and return the CPU time of each [ms]."""
    return np.array([take_in(mapper, log, row) for row in rows])


def judge_grid(grid: Grid, flat: Flat) -> tuple[float, float]:
    """Return the shares [%] of occupied cells that are right and of free cells that are wrong."""
    occupied = grid.to_points(np.argwhere(grid.cells == OCCUPIED))
    free = grid.to_points(np.argwhere(grid.cells == FREE))
    right = np.abs(surface_distance(occupied, flat.boxes)) <= grid.resolution
    wrong = surface_distance(free, flat.boxes) < 0.0
    return 100.0 * float(right.mean()), 100.0 * float(wrong.mean())


def is_read_equal(grid: Grid) -> bool:
    """Whether an independent reader finds a grid in its files, by map_server's rules."""
    with tempfile.TemporaryDirectory() as folder:
        text, _ = save_map(grid, Path(folder, 'map'))
        said = yaml.safe_load(text.read_text())
        pixels = np.asarray(Image.open(text.parent / said['image']), dtype=float)
    occupied = (255.0 - pixels) / 255.0
    cells = np.full(pixels.shape, -1)
    cells[occupied > said['occupied_thresh']] = 100
    cells[occupied < said['free_thresh']] = 0
    place = [*grid.origin, 0], grid.resolution
    return np.array_equal(cells[::-1], grid.cells) and place == (
        said['origin'],
        said['resolution'],
    )


def map_once(log: Log, flat: Flat, seed: int) -> tuple[dict[str, Any], Grid]:
    """Map a log; return the trial and the grid."""
    mapper = Mapper()
    costs, within = np.zeros(len(log.scans)), []
    for row in range(len(log.scans)):
        costs[row] = take_in(mapper, log, row)
        place = mapper.reference  # a closure moves it, and what lies in it
        within.append((place, compose(inverse(mapper.places[place]), mapper.pose)))
    right, wrong = judge_grid(mapper.grid, flat)
    poses = np.array([compose(mapper.places[place], pose) for place, pose in within])
    away = np.hypot(*(poses - log.truth)[:, :2].T)
    trial = {
        'seed': seed,
        'way': log.length,
        'scans': len(log.scans),
        'error': trajectory_error(poses, log.truth),
        'unaligned': error_of(poses, log.truth),
        'largest': float(away.max()),
        'dead_reckoning': trajectory_error(log.odometry, log.truth),
        'closures': mapper.closures,
        'occupied_right': right,
        'free_wrong': wrong,
        'file_equal': is_read_equal(mapper.grid),
        'cpu_median': float(np.median(costs)),
        'cpu_p99': float(np.percentile(costs, 99)),
        'cpu_mean': float(costs.mean()),
        'costs': costs,
    }
    return trial, mapper.grid


def error_row(what: str, trials: Sequence[dict[str, Any]], bounds: tuple[float, float]) -> Row:
    """Return the row of errors of runs, with dead reckoning and Karto beside them."""
    median = float(np.median([trial['error'] for trial in trials]))
    worst = max(trial['error'] for trial in trials)
    dead = float(np.median([trial['dead_reckoning'] for trial in trials]))
    anchors = [trial['karto'] for trial in trials if trial.get('karto') is not None]
    karto = f'Karto {1e3 * float(np.median(anchors)):.1f} mm' if anchors else WHY_NOT
    if anchors:
        karto += f', {1e3 * max(anchors):.1f} at worst ({len(anchors)} runs)'
    for trial in trials:
        trial['passed'] = trial['error'] <= bounds[1]
    return Row(
        what=what,
        measured=f'{say_errors(trials)}, {len(trials)} runs',
        must=f'<= {1e3 * bounds[0]:g} mm, {1e3 * bounds[1]:g} at worst',
        passed=median <= bounds[0] and worst <= bounds[1],
        anchor=f'dead reckoning {1e3 * dead:.0f} mm; {karto}',
        trials=trials,
    )


def map_rows(trials: Sequence[dict[str, Any]]) -> list[Row]:
    """Return the rows of grids, files and costs of all runs; the costs are taken out of these."""
    right = min(trial['occupied_right'] for trial in trials)
    wrong = max(trial['free_wrong'] for trial in trials)
    equal = sum(trial['file_equal'] for trial in trials)
    costs = np.concatenate([trial.pop('costs') for trial in trials])
    median, p99 = np.percentile(costs, (50.0, 99.0))
    worst = max(trial['cpu_p99'] for trial in trials)
    count = len(trials)
    return [
        Row(
            what='map: occupied cells right, the worst run',
            measured=f'{right:.2f} % of {count} runs',
            must='>= 99.5 %',
            passed=right >= 99.5,
        ),
        Row(
            what='map: free cells that are occupied, the worst run',
            measured=f'{wrong:.3f} % of {count} runs',
            must='<= 0.1 %',
            passed=wrong <= 0.1,
        ),
        Row(
            what='map: YAML and PGM as an independent reader has them',
            measured=format_count(equal, count),
            must='all equal',
            passed=equal == count,
        ),
        Row(
            what='map: CPU of a scan, closures and drawing included',
            measured=f'{median:.2f} ms, p99 {p99:.2f} ms of {len(costs)} scans, {worst:.2f} ms of '
            'the worst run',
            must='<= 0.6 ms, p99 <= 3 ms',
            passed=bool(median <= 0.6 and p99 <= 3.0),
            anchor='Karto 3.9 ms, p99 18.5 ms',
        ),
    ]


def error_at(pose: np.ndarray, truth: np.ndarray) -> float:
    """Return how far a pose is off [m]."""
    return math.hypot(pose[0] - truth[0], pose[1] - truth[1])


def choose(random: np.random.Generator, mapped: np.ndarray, count: int) -> int:
    """Return a row of a log from which on so many rows are all where the map was made."""
    whole = np.convolve(mapped, np.ones(count), mode='valid') == count
    return int(random.choice(np.flatnonzero(whole)))


def is_mapped(log: Log, way: Log) -> np.ndarray:
    """Return at which rows of a log the robot is within a metre of the way of another."""
    steps = log.truth[:, None, :2] - way.truth[None, ::5, :2]
    near: np.ndarray = np.hypot(steps[..., 0], steps[..., 1]).min(axis=1) < 1.0
    return near


def localise_near(grid: Grid, log: Log, mapped: np.ndarray, seed: int) -> dict[str, Any]:
    """Start half a metre and 30 degrees off; say the largest error from 3 s on, for 3 s."""
    random = np.random.default_rng((seed, 4))
    begin = choose(random, mapped, 40)
    angle, side = random.uniform(0.0, 2.0 * math.pi), random.choice((-1.0, 1.0))
    off = (0.5 * math.cos(angle), 0.5 * math.sin(angle), side * math.radians(30.0))
    localizer = Localizer(grid)
    localizer.start(log.truth[begin] + off, np.diag((0.25, 0.25, 0.07)))
    worst, yaw = 0.0, 0.0
    for row in range(begin, begin + 33):
        follow(localizer, log, range(row, row + 1))
        if log.stamps[row] - log.stamps[begin] >= 3.0 - 1.0 / 5.5:
            worst = max(worst, error_at(localizer.pose, log.truth[row]))
            yaw = max(yaw, abs(wrap(localizer.pose[2] - log.truth[row, 2])))
    passed = bool(localizer.is_found and worst <= 0.02)
    return {'seed': seed, 'passed': passed, 'error': worst, 'yaw': math.degrees(yaw)}


def localise_anywhere(grid: Grid, log: Log, mapped: np.ndarray, seed: int) -> dict[str, Any]:
    """Start from nowhere, drive on until the place is found, and 3 s more."""
    random = np.random.default_rng((seed, 5))
    begin = choose(random, mapped[:-400], 40)
    localizer = Localizer(grid)
    costs, row = [], begin
    while not localizer.is_found and row < begin + 380:
        costs += follow(localizer, log, range(row, row + 1)).tolist()
        row += 1
    seconds = float(log.stamps[row - 1] - log.stamps[begin])
    follow(localizer, log, range(row, row + 16))
    error = error_at(localizer.pose, log.truth[row + 15])
    return {
        'seed': seed,
        'passed': bool(localizer.is_found and error <= 0.05),
        'seconds': seconds,
        'error': error,
        'cpu_p99': float(np.percentile(costs, 99)),
    }


def move_by_hand(grid: Grid, log: Log, mapped: np.ndarray, seed: int) -> dict[str, Any]:
    """Put the robot to where it is later, which odometry does not know of."""
    random = np.random.default_rng((seed, 6))
    begin, later = (choose(random, mapped[:-300], 40) for _ in range(2))
    while error_at(log.truth[begin + 30], log.truth[later]) < 0.5:
        later = choose(random, mapped[:-300], 40)
    localizer = Localizer(grid)
    localizer.start(log.truth[begin], np.diag((0.01, 0.01, 0.01)))
    follow(localizer, log, range(begin, begin + 30))
    known = localizer.is_found
    last, grown = log.odometry[begin + 29], log.covariances[begin + 29]
    said, found, row = math.inf, math.inf, later
    while row < later + 300 and not (
        said < math.inf and localizer.is_found and localizer.notice is None
    ):
        pose = compose(last, compose(inverse(log.odometry[later]), log.odometry[row]))
        covariance = grown + np.eye(3) * 1e-5 * (row - later)
        localizer.step(log.scans[row], pose, covariance)
        if localizer.notice is not None and 'moved by hand' in localizer.notice:
            said = min(said, float(log.stamps[row] - log.stamps[later]))
        row += 1
    if localizer.is_found:
        found = float(log.stamps[row - 1] - log.stamps[later])
    return {
        'seed': seed,
        'passed': bool(known and said <= 2.0),
        'said': said,
        'found_again': found,
        'error': error_at(localizer.pose, log.truth[row - 1]),
    }


def localise_rows(trials: dict[str, list[dict[str, Any]]]) -> list[Row]:
    """Return the rows of localising."""
    rows = []
    for name, what, must, share in (
        ('near', 'localise: from 0.5 m and 30 degrees off, after 3 s', '<= 20 mm', 1.0),
        ('anywhere', 'localise: from nowhere', 'right place', 0.95),
        ('hand', 'localise: moved by hand', 'said within 2 s', 1.0),
    ):
        done = trials[name]
        passed = sum(trial['passed'] for trial in done)
        needed = math.ceil(share * len(done) - 1e-9)
        worst = f'{1e3 * max(trial["error"] for trial in done):.0f} mm'
        if name == 'anywhere':
            worst += f', found after {np.median([trial["seconds"] for trial in done]):.1f} s'
        if name == 'hand':
            worst = f'said after {max(trial["said"] for trial in done):.1f} s at worst'
        rows.append(
            Row(
                what=what,
                measured=f'{format_count(passed, len(done))}, {worst}',
                must=f'{must}: >= {needed} of {len(done)}',
                passed=passed >= needed,
                trials=done,
            )
        )
    return rows


def map_real_mbot(seed: int) -> Row:
    """Map a flat with mbot in physics, its own wheels and its own lidar."""
    flat = make_flat(seed)
    trial, _ = map_once(drive_mbot(seed, LENGTH), flat, seed)
    del trial['costs']
    return error_row('slam: mbot in physics, its odometry and lidar', [trial], IN_PHYSICS)


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of the benchmark."""
    seeds = range(FIRST_SEED, FIRST_SEED + (3 if quick else 20))
    errors: dict[str, list[dict[str, Any]]] = {name: [] for name in (*BOUNDS, 'own')}
    located: dict[str, list[dict[str, Any]]] = {'near': [], 'anywhere': [], 'hand': []}
    # Compiled before anything is timed.
    flat = make_flat(0)
    map_once(make_logs(flat, ['mbot'], 0, 30.0)['mbot'], flat, 0)
    for seed in seeds:
        note(f'slam: seed {seed}')
        flat = make_flat(seed)
        logs = make_logs(flat, list(BOUNDS), seed, LENGTH)
        for name, log in logs.items():
            trial, grid = map_once(log, flat, seed)
            trial['karto'] = map_by_karto(log) if not quick and seed < FIRST_SEED + 5 else None
            errors[name].append(trial)
        # Other ways and other noise than those of the map.
        other = make_logs(flat, ['mbot'], seed + 500, LENGTH)['mbot']
        mapped = is_mapped(other, logs['mbot'])
        located['near'].append(localise_near(grid, other, mapped, seed))
        located['anywhere'].append(localise_anywhere(grid, other, mapped, seed))
        located['hand'].append(move_by_hand(grid, other, mapped, seed))
        log = make_logs(flat, ['go2'], seed, LENGTH, GO2_LIDAR)['go2']
        errors['own'].append(map_once(log, flat, seed)[0])
    rows = [
        error_row(f'slam: ATE on {LENGTH:g} m, {WORDS[name]}', errors[name], bounds)
        for name, bounds in BOUNDS.items()
    ]
    rows.append(error_row('slam: Go2-like, a lidar of 12 m', errors['own'], BOUNDS['go2']))
    rows += map_rows([trial for name in errors for trial in errors[name]])
    rows += localise_rows(located)
    rows += measure_places(map_once, list(seeds), note)
    rows += measure_localising(len(seeds), note)
    rows += measure_sill(len(seeds), note)
    note('slam: a long way')
    rows.append(measure_far(1 if quick else 3))
    note('slam: mbot in physics')
    rows.append(map_real_mbot(FIRST_SEED))
    rows.append(measure_speed(f'flat:{FIRST_SEED}', 1 if quick else 5, note))
    return rows
