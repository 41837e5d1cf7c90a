# SPDX-License-Identifier: Apache-2.0
"""How fast simulated time goes while mbot maps, and how fast without."""

from collections.abc import Callable
import json
from pathlib import Path
import statistics
import tempfile

from mbot_accuracy import run_quietly
from table import Row

LEAST = 10.0  # real-time factor while it maps
DURATION = 60.0  # of each run, simulated [s]
# A small circle, on which every scan is another and places are kept: there is room for it.
CIRCLE = '0 0.1 0 0.5\n'


def real_time_factor(folder: Path, world: str, *options: str) -> float:
    """Return how many simulated seconds pass in one with mbot on its circle, nothing shown."""
    script, report = folder / 'circle.txt', folder / 'report.json'
    script.write_text(CIRCLE)
    words = ['mbot', '--world', world, '--twist', str(script), '--duration', f'{DURATION:g}']
    run_quietly([*words, '--speed', '0', '--report', str(report), *options])
    return float(json.loads(report.read_text())['real_time_factor'])


def measure_speed(world: str, pairs: int, note: Callable[[str], None]) -> Row:
    """Return the row of runs with and without `--map`, by turns: a figure of wall time."""
    trials = []
    with tempfile.TemporaryDirectory() as name:
        for pair in range(pairs):
            note(f'slam: real-time factor, pair {pair + 1}')
            without = real_time_factor(Path(name), world)
            mapping = real_time_factor(Path(name), world, '--map')
            trials.append({'mapping': mapping, 'without': without, 'share': mapping / without})
    mapping, without, share = (
        statistics.median(trial[key] for trial in trials)
        for key in ('mapping', 'without', 'share')
    )
    return Row(
        what='slam: real-time factor of mbot mapping, --speed 0',
        measured=f'{mapping:.1f}, of {without:.1f} without --map: {100 * share:.0f} %, '
        f'{pairs} pairs',
        must=f'>= {LEAST:g}',
        passed=mapping >= LEAST,
        trials=trials,
    )
