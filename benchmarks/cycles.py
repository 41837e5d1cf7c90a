# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of coming and going: every program is started and stopped again and again.

What a process had in shared memory, the temporary folder, the home and its children must be as
before; a node that is made and destroyed in one process leaves no thread and no descriptor.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
import itertools
import multiprocessing
import os
import statistics
from typing import Any

from cycled_nodes import Held, NODES, repeat_node
from cycled_programs import (
    Cycled,
    is_segment,
    kill_and_start_again,
    port_of,
    PROGRAMS,
    repeat_program,
)
from table import Row

QUICK = 3
# Those that load or compile most take seconds each.
FULL = {**dict.fromkeys(PROGRAMS, 200), 'leg_controller': 50, 'wasd mbot': 50, 'wasd go2': 50}
IN_PROCESS, QUICK_IN_PROCESS = 200, 30
# In the first part of the cycles caches fill: of ROS, numba, MuJoCo.
SETTLED = 0.25
# Memory that a cycle may take for good [kB]: of a node without topics ROS keeps about 3.
GROWTH = 10.0
KILLED, QUICK_KILLED = 5, 2
# Fast DDS leaves a port's file (50 kB) behind now and then, also at a clean end. Who comes next
# with the same number takes it over: they do not add up. One participant has two, a watcher two.
PORTS = 4


def judge_program(cycled: Cycled) -> Row:
    """Return the row of a program that was a process of its own each time."""
    left: dict[str, Sequence[object]] = {
        'in shared memory': [name for name in cycled.shared if is_segment(name)],
        'in home and temporary folder': cycled.files,
        'processes': cycled.children,
        'wrong ends': [status for status in cycled.statuses if status not in (0, 130)],
    }
    ports = sorted({port_of(name) for name in cycled.shared if not is_segment(name)})
    left |= {'ports': ports if len(ports) > PORTS else []}
    return Row(
        what=f'{cycled.name}: {len(cycled.statuses)} starts and Ctrl-C, left behind',
        measured=', '.join(f'{len(items)} {what}' for what, items in left.items() if items)
        or f'nothing{f", {len(ports)} ports" if ports else ""}',
        must=f'nothing, <= {PORTS} ports',
        passed=not any(left.values()),
        trials=[cycled._asdict()],
    )


def judge_node(name: str, holds: Sequence[Held]) -> Row:
    """Return the row of a node made and destroyed in one process."""
    steady = holds[round(SETTLED * len(holds)) :]
    # What leaks, leaks all along; free memory in pieces is a step now and then, of 2 MB, say.
    span = max(1, len(steady) // 4)
    pairs = zip(steady, steady[span:], strict=False)
    growth = statistics.median((after.memory - before.memory) / span for before, after in pairs)
    counts = {(held.threads, held.descriptors) for held in steady}
    threads, descriptors = (sorted({pair[index] for pair in counts}) for index in (0, 1))
    # Too few cycles say nothing of memory: a page here or there is all that is seen.
    is_judged = len(holds) >= IN_PROCESS
    return Row(
        what=f'{name}: {len(holds)} times made and destroyed',
        measured=f'{threads} threads, {descriptors} descriptors, {growth:+.1f} kB a time',
        must=f'constant, <= {GROWTH} kB' if is_judged else 'constant',
        passed=len(counts) == 1 and not (is_judged and growth > GROWTH),
        trials=[held._asdict() for held in holds],
    )


def judge_kills(trial: dict[str, Any]) -> Row:
    """Return the row of a node that was killed."""
    return Row(
        what=f'twist_mux: {trial["kills"]} times killed (SIGKILL); segments left, a minute later',
        measured=f'{len(trial["left"])}; after the next start {len(trial["later"])}',
        must='0 after a start',
        passed=not trial['later'],
        trials=[trial],
    )


def measure(
    quick: bool,
    note: Callable[[str], None],
    programs: dict[str, int] | None = None,
    in_process: int | None = None,
    workers: int | None = None,
) -> list[Row]:
    """Return the rows; `programs` says how often each is started, `in_process` how often made."""
    programs = programs or (dict.fromkeys(PROGRAMS, QUICK) if quick else FULL)
    times = in_process or (QUICK_IN_PROCESS if quick else IN_PROCESS)
    # What each process begins with is loaded once; rclpy has started nothing by then.
    forking = multiprocessing.get_context('forkserver')
    forking.set_forkserver_preload([name.partition(':')[0] for name in NODES.values()])
    workers = workers or len(os.sched_getaffinity(0))
    turns, kills = itertools.count(), QUICK_KILLED if quick else KILLED
    rows = []
    with ProcessPoolExecutor(workers, mp_context=forking, max_tasks_per_child=1) as pool:
        made = {name: pool.submit(repeat_node, name, times, next(turns)) for name in NODES}
        killed = pool.submit(kill_and_start_again, kills, next(turns))
        started = [
            pool.submit(repeat_program, name, n, next(turns)) for name, n in programs.items()
        ]
        for name, future in made.items():
            rows.append(judge_node(name, future.result()))
            note(f'cycles: {name} made')
        rows.append(judge_kills(killed.result()))
        for run in started:
            rows.append(judge_program(run.result()))
            note(f'cycles: {run.result().name} started')
    return rows
