# SPDX-License-Identifier: Apache-2.0
"""Time and the Go2: what must not depend on the machine, and what does."""

from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import replace
import json
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from environment import alone, together
from experiment import Experiment, Verdict
from table import at_most, Row
from trials import Run, simulate, START, Trace, WASD

TOPICS = (sys.executable, str(Path(__file__).resolve().parent / 'topics.py'))
TOPICS_PATIENCE = 180.0


def slow_host(seed: int, speeds: Sequence[float]) -> Experiment:
    """Run the same short script on a host that is slow, on time, and fast."""
    base = Run(seed=seed, twist=f'{START} 0.8 0 0.5\n', duration=5.0, command=True)
    runs = [replace(base, speed=speed) for speed in speeds]
    names = ', '.join(f'{speed:g}' for speed in speeds)

    def judge(traces: Sequence[Trace]) -> Verdict:
        same = [trace.digest == traces[0].digest for trace in traces]
        trials = [
            trace.record(equal, speed=trace.run.speed, x=float(trace.position[-1, 0]))
            for trace, equal in zip(traces, same, strict=True)
        ]
        count = len(traces[0].t)
        text = f'{count} samples identical' if all(same) else 'samples differ'
        return Verdict(f'{text} ({traces[0].run.duration:g} s)', all(same), trials)

    return Experiment(
        what=f'slow host: --speed {names}',
        must='identical samples',
        runs=runs,
        judge=judge,
        anchor='unitree_guide falls',
    )


def determinism(seed: int, world: str) -> Experiment:
    """Run the same twice, over rough ground and with noise."""
    base = Run(seed=seed, twist=f'{START} 0.5 0 0\n', duration=START + 8.0, world=world)
    base = replace(base, command=True)
    runs = [base, replace(base, repeat=1)]

    def judge(traces: Sequence[Trace]) -> Verdict:
        same = traces[0].digest == traces[1].digest
        trials = [trace.record(same, x=float(trace.position[-1, 0])) for trace in traces]
        return Verdict('identical' if same else 'reports differ', same, trials)

    what = f'determinism: two runs on {world}'
    return Experiment(what=what, must='identical reports', runs=runs, judge=judge)


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """Let what this thread starts have one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def ticks(seed: int, count: int) -> list[Row]:
    """Measure the controller's ticks and the whole simulation's speed on one core."""
    run = Run(seed=seed, twist=f'{START} 1.0 0 0\n', duration=START + 17.0, command=True)
    with one_core():
        reports = [simulate(replace(run, repeat=index)).report for index in range(count)]
    factors = [report['real_time_factor'] for report in reports]
    median = [1e-3 * report['tick']['median_us'] for report in reports]
    tail = [1e-3 * report['tick']['p99_us'] for report in reports]
    factor = statistics.median(factors)
    return [
        at_most('go2: 500 Hz tick on one core, median', median, 'ms', 0.2),
        at_most('go2: 500 Hz tick on one core, p99', tail, 'ms', 0.8),
        Row(
            what='go2: real-time factor on one core, --speed 0',
            measured=f'{factor:.2f}',
            must='>= 6',
            passed=factor >= 6.0,
            anchor='go2-convex-mpc: 1.1-1.2',
            trials=[{'seed': seed, 'value': value} for value in factors],
        ),
    ]


def walk_over_topics() -> dict[str, Any]:
    """Return what topics.py says of one walk; only `error` when it could not be."""
    try:
        finished = subprocess.run(
            TOPICS, env=together(), capture_output=True, text=True, timeout=TOPICS_PATIENCE
        )
    except subprocess.TimeoutExpired:
        return {'error': f'no end in {TOPICS_PATIENCE:g} s'}
    lines = finished.stdout.splitlines()
    if not lines:
        return {'error': finished.stderr.strip()[-300:]}
    trial: dict[str, Any] = json.loads(lines[-1])
    return trial


def over_topics(count: int) -> Row:
    """Walk with simulator and leg controller in two processes; the median run counts."""
    trials = []
    for _ in range(count):
        load = os.getloadavg()[0]
        trial = {'load_average_before': load, **walk_over_topics()}
        trial['passed'] = (
            'error' not in trial
            and trial['state'] == 'move base'
            and trial['tilt_max_deg'] < 60.0
            and trial['real_time_factor'] >= 0.8
            and abs(trial['speed'] / 0.5 - 1.0) <= 0.1
        )
        trials.append(trial)
    good = [trial for trial in trials if 'error' not in trial]
    measured = trials[0].get('error', '')
    if good:
        factor = statistics.median(trial['real_time_factor'] for trial in good)
        speed = statistics.median(trial['speed'] for trial in good)
        up = sum(trial['passed'] for trial in trials)
        measured = f'x{factor:.2f}, {speed:.3f} m/s, {up}/{count} walked 20 s'
    return Row(
        what='go2: leg_controller as a process of its own, over topics',
        measured=measured,
        must='20 s at 0.5 m/s, x0.8 or more (two idle cores)',
        passed=all(trial['passed'] for trial in trials),
        trials=trials,
    )


def first_start(count: int) -> Row:
    """Time the command from its start until the robot has stood up and it has ended."""
    times = []
    with tempfile.TemporaryDirectory() as folder:
        keys, report = Path(folder, 'keys'), Path(folder, 'report.json')
        keys.write_text('0 2\n')
        words = ['go2', '--play', str(keys), '--duration', '2.1', '--speed', '0']
        for _ in range(count):
            begin = time.monotonic()
            subprocess.run(
                [*WASD, *words, '--report', str(report)],
                env=alone(),
                check=True,
                stdin=subprocess.DEVNULL,
                capture_output=True,
            )
            times.append(time.monotonic() - begin)
        height = json.loads(report.read_text())['samples']['position'][-1][2]
    row = at_most('go2: first start to a standing robot, warm venv', times, 's', 8.0)
    if height >= 0.31:
        return row
    return replace(row, measured=f'it does not stand: {height:.3f} m', passed=False)
