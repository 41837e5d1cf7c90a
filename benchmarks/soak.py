# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of staying as it is: `wasd both` for half an hour of simulated time, with random keys.

The keys are of all kinds: sticks, states, speeds, TAB, help, nonsense, now and then a reset.

Memory of the process must be flat after its first minutes; threads and descriptors must be
constant; nobody falls. What counts is what the process holds, so a busy machine only takes longer.
"""

from collections.abc import Callable
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from cycled_nodes import held_by
from environment import alone
from random_keys import random_keys
from table import Row

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
FULL, SETTLED = 1800.0, 300.0  # how long, and after how long it is flat [s of simulated time]
QUICK, QUICK_SETTLED = 90.0, 30.0
FLAT = 0.02  # largest over smallest memory, less one
LOOK_PERIOD = 1.0  # of wall time [s]
ENDING = 3.0  # before the end; the last key may be that old when the report is put together [s]


class Look(NamedTuple):
    """What a process holds at a simulated time [s]: memory [kB], threads, descriptors."""

    time: float
    memory: int
    threads: int
    descriptors: int


def look(pid: int, now: float) -> Look:
    """Return what a process holds now."""
    return Look(now, *held_by(pid))


def soak(
    duration: float, seed: int, note: Callable[[str], None]
) -> tuple[list[Look], dict[str, Any]]:
    """Run both robots; return what was seen, and the report without its samples."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'keys').write_text(random_keys(duration, seed))
        words = ['both', '--play', str(folder / 'keys'), '--duration', str(duration)]
        words += ['--speed', '0', '--seed', str(seed), '--save-keys', str(folder / 'saved')]
        process = subprocess.Popen(
            [*WASD, *words, '--report', str(folder / 'report.json')],
            env=alone(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        looks = []
        try:
            while process.poll() is None:
                time.sleep(LOOK_PERIOD)
                now = _last_time(folder / 'saved')
                if now > 0.0:
                    try:
                        looks.append(look(process.pid, now))
                    except ProcessLookupError:
                        break
                    note(f'soak: {now:.0f} of {duration:.0f} s, {looks[-1].memory / 1024:.1f} MB')
        finally:
            process.kill()
            process.wait()
        report = json.loads((folder / 'report.json').read_text())
    falls = {robot: part['falls'] for robot, part in report['robots'].items()}
    return looks, {'falls': falls, 'sim_time': report['sim_time']}


def _last_time(saved: Path) -> float:
    """Return when the last key was pressed, which says how far the run is [s]."""
    try:
        lines = saved.read_text().splitlines()
    except FileNotFoundError:
        return 0.0
    return float(lines[-1].split()[0]) if lines else 0.0


def judge(looks: list[Look], report: dict[str, Any], duration: float, settled: float) -> Row:
    """Return the row of a run."""
    # At its end the report is put together, which is no part of the drive.
    steady = [one for one in looks if settled <= one.time < duration - ENDING]
    falls = sum(report['falls'].values())
    trials = [one._asdict() for one in looks]
    must = f'{100 * FLAT:.0f} %, no fall, threads and descriptors constant'
    what = f'both, {duration / 60:g} min: memory of the last {(duration - settled) / 60:g} min'
    if len(steady) < 5:
        return Row(what=what, measured='too few looks', must=must, passed=False, trials=trials)
    memory = [one.memory for one in steady]
    growth = max(memory) / min(memory) - 1.0
    counts = {(one.threads, one.descriptors) for one in steady}
    threads, descriptors = (sorted({pair[index] for pair in counts}) for index in (0, 1))
    return Row(
        what=what,
        measured=f'{100 * growth:.2f} % of {memory[0] / 1024:.0f} MB, {falls} falls, '
        f'{threads} threads, {descriptors} descriptors',
        must=must,
        passed=growth <= FLAT and not falls and len(counts) == 1,
        trials=trials,
    )


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the row of the soak."""
    duration, settled = (QUICK, QUICK_SETTLED) if quick else (FULL, SETTLED)
    looks, report = soak(duration, 1, note)
    return [judge(looks, report, duration, settled)]
