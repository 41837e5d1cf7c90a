# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of mbot: accuracy, speed, start-up, idle cost.

Accuracy is simulated, so it is the same on every machine. The rest depends on the machine: each
such row is the median of several runs in one go.
"""

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path
import pty
import statistics
import subprocess
import sys
import tempfile
import time

from environment import alone
from mbot_accuracy import calibration, odometry, sensors, simulate
from table import at_most, Row

HOLD = 89.0 / 30.0  # from the first to the last of 90 presses, 30 a second [s]
RELEASE_DELAY = 0.12  # after its last press a repeating key counts as released [s]


def ramp_law(folder: Path) -> list[Row]:
    """Compare how far a held key leads with its ramp law."""
    held = simulate(folder, '--play', '0.5 i*90', 8.0)
    law = 0.2 * (HOLD + RELEASE_DELAY)
    moved = held['samples']['position'][-1][0]
    return [at_most('i held 3 s, off the ramp law', 100 * abs(moved / law - 1), '%', 3.0)]


def speed(folder: Path, runs: int) -> list[Row]:
    """Measure the real-time factor at full speed and the controller's ticks."""
    reports = [simulate(folder, '--play', '0.5 i*900 j*900', 60.0) for _ in range(runs)]
    factors = [report['real_time_factor'] for report in reports]
    factor = statistics.median(factors)
    return [
        Row(
            what='real-time factor, --speed 0',
            measured=f'{factor:.0f}',
            must='>= 10',
            passed=factor >= 10.0,
            trials=[{'value': value} for value in factors],
        ),
        at_most(
            'controller tick at 200 Hz, median',
            [report['tick']['median_us'] for report in reports],
            'us',
            100.0,
        ),
        at_most(
            'controller tick at 200 Hz, p99',
            [report['tick']['p99_us'] for report in reports],
            'us',
            1000.0,
        ),
    ]


def start_up(folder: Path, runs: int) -> list[Row]:
    """Measure a whole run of one physics step: its end is after the first step."""
    times = []
    for _ in range(runs):
        begin = time.monotonic()
        simulate(folder, '--play', '', 0.001)
        times.append(time.monotonic() - begin)
    return [at_most('warm start, first physics step and exit', times, 's', 4.0)]


def idle(seconds: float) -> list[Row]:
    """Measure what key_publisher costs while nobody types."""
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, '-m', 'teleop_keyboard.key_publisher_node'],
        env=alone(),
        stdin=slave,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        time.sleep(2.0)
        before = cpu_time(process.pid)
        time.sleep(seconds)
        used = cpu_time(process.pid) - before
    finally:
        process.terminate()
        process.wait()
        os.close(master)
        os.close(slave)
    return [at_most('key_publisher, idle CPU', 100 * used / seconds, '% of a core', 2.0)]


def cpu_time(pid: int) -> float:
    """Return the user and system time of a process [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure everything and return the rows; `note` is told how far it is."""
    runs = 1 if quick else 5
    parts: list[Callable[[Path], list[Row]]] = [
        odometry,
        lambda folder: calibration(folder, 1 if quick else 5),
        lambda _: sensors(100),
        ramp_law,
        lambda folder: speed(folder, runs),
        lambda folder: start_up(folder, runs),
        lambda _: idle(3.0 if quick else 10.0),
    ]
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for index, part in enumerate(parts):
            note(f'mbot: part {index + 1} of {len(parts)}')
            rows += part(Path(folder))
    return [replace(row, what=f'mbot: {row.what}') for row in rows]
