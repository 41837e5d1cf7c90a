# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of staying as it is: `wasd both` for half an hour of simulated time, with random keys.

Memory of the process must be flat after its first minutes; threads and descriptors must be
constant; nobody falls. What counts is what the process holds, so a busy machine only takes longer.
"""

from collections.abc import Callable
import json
from pathlib import Path
import random
import re
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from both import GO2_KEYS
from both import MBOT_KEYS
from environment import alone
from table import Row

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
FULL, SETTLED = 1800.0, 300.0  # how long, and after how long it is flat [s of simulated time]
QUICK, QUICK_SETTLED = 180.0, 60.0
FLAT = 0.02  # largest over smallest memory, less one
LOOK_PERIOD = 1.0  # of wall time [s]


class Look(NamedTuple):
    """What a process holds at a simulated time [s]: memory [kB], threads, descriptors."""

    time: float
    memory: int
    threads: int
    descriptors: int


def random_keys(duration: float, seed: int) -> str:
    """Return a key script that drives both robots by turns, for ever on the move."""
    chance = random.Random(seed)
    lines, time_, name = ['0.2 2', '3.2 4'], 5.0, 'go2'
    while time_ < duration - 4.0:
        end = time_ + chance.uniform(1.0, 3.0)
        lines.append(
            f'{time_ + 0.02:.3f} {chance.choice(MBOT_KEYS if name == "mbot" else GO2_KEYS)}'
        )
        if name == 'go2':
            # Its sticks stay where they are: they would add up.
            lines.append(f'{end - 0.05:.3f} SPACE')
        lines.append(f'{end:.3f} TAB')
        time_, name = end, 'go2' if name == 'mbot' else 'mbot'
    return '\n'.join(lines)


def look(pid: int, now: float) -> Look:
    """Return what a process holds now."""
    status = Path(f'/proc/{pid}/status').read_text()
    memory, threads = (
        int(re.search(rf'^{name}:\s+(\d+)', status, re.MULTILINE)[1])  # type: ignore[index]
        for name in ('VmRSS', 'Threads')
    )
    return Look(now, memory, threads, len(list(Path(f'/proc/{pid}/fd').iterdir())))


def soak(duration: float, seed: int, note: Callable[[str], None]) -> tuple[list[Look], dict]:
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
                if now > 0.0 and process.poll() is None:
                    looks.append(look(process.pid, now))
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
    steady = [one for one in looks if settled <= one.time < duration - 10.0]
    falls = sum(report['falls'].values())
    trials = [one._asdict() for one in looks]
    must = f'{100 * FLAT:.0f} %, no fall, threads and descriptors constant'
    what = f'both, {duration / 60:.0f} min: memory of the last {(duration - settled) / 60:.0f} min'
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
