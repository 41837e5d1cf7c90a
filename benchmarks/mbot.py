# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of mbot: accuracy, speed, start-up, idle cost.

Accuracy is simulated, so it is the same on every machine. The rest depends on the machine: each
such row is the median of several runs in one go.
"""

from collections.abc import Callable
from dataclasses import replace
import json
import math
import os
from pathlib import Path
import pty
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from table import at_most
from table import Row

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
SQUARE = '\n'.join(
    f'{7 * side} 0.25 0 0\n{7 * side + 4} 0 0 0\n'
    f'{7 * side + 4.5} 0 0 {math.pi / 4}\n{7 * side + 6.5} 0 0 0'
    for side in range(4)
)
HOLD = 89.0 / 30.0  # from the first to the last of 90 presses, 30 a second [s]
RELEASE_DELAY = 0.12  # after its last press a repeating key counts as released [s]


def simulate(folder: Path, option: str, script: str, duration: float) -> dict[str, Any]:
    """Run `wasd mbot` on a script at full speed and return its report."""
    (folder / 'script').write_text(script)
    report = folder / 'report.json'
    words = ('mbot', option, str(folder / 'script'), '--duration', str(duration), '--speed', '0')
    subprocess.run(
        [*WASD, *words, '--report', str(report)],
        check=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    loaded: dict[str, Any] = json.loads(report.read_text())
    return loaded


def odometry_error(report: dict[str, Any]) -> tuple[float, float]:
    """Return the largest error at any time: distance [mm], yaw [degrees]."""
    samples = report['samples']
    rows = zip(samples['position'], samples['rpy'], samples['odom'], strict=True)
    errors = [
        (math.dist(p[:2], o[:2]), abs(math.remainder(r[2] - o[2], 2 * math.pi)))
        for p, r, o in rows
    ]
    return 1e3 * max(e[0] for e in errors), math.degrees(max(e[1] for e in errors))


def accuracy(folder: Path) -> list[Row]:
    """Measure odometry against truth, and the ramp law of a held key."""
    straight = simulate(folder, '--twist', '0 0.5 0 0\n4 0 0 0', 6.0)
    spin = simulate(folder, '--twist', f'0 0 0 1\n{2 * math.pi} 0 0 0', 8.0)
    square = simulate(folder, '--twist', SQUARE, 29.0)
    held = simulate(folder, '--play', '0.5 i*90', 8.0)
    law = 0.2 * (HOLD + RELEASE_DELAY)
    moved = held['samples']['position'][-1][0]
    return [
        at_most('odometry, 2 m straight', odometry_error(straight)[0], 'mm', 1.0),
        at_most('odometry, 360 degrees on the spot', odometry_error(spin)[1], 'deg', 0.1),
        at_most('odometry, 4 x 1 m square', odometry_error(square)[0], 'mm', 2.0),
        at_most('i held 3 s, off the ramp law', 100 * abs(moved / law - 1), '%', 3.0),
    ]


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
        accuracy,
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
