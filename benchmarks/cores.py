# SPDX-License-Identifier: Apache-2.0
"""
Many runs at once: on all cores of this machine, or on those of a Dask cluster.

A run is the same wherever it is simulated, so the figures are those of one after the other.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
import multiprocessing
import os
from pathlib import Path
from typing import Any, TypeVar

from family import end_with_parent
from trials import Run, RunFailed, simulate, Trace

HERE = Path(__file__).resolve().parent
# What workers of a cluster need of the benchmark, in the order of its imports.
SENT = ('environment', 'walking', 'trials', 'family', 'cores')
# Address of a Dask scheduler; '' is this machine.
cluster = ''
Result = Trace | RunFailed
Task = TypeVar('Task')
Done = TypeVar('Done')


def simulate_all(runs: Sequence[Run], note: Callable[[str], None]) -> dict[Run, Result]:
    """Run each once, as many at a time as there are cores; `note` is told how far it is."""
    # Longest first: none is left to one core at the end.
    wanted = sorted(dict.fromkeys(runs), key=lambda run: -run.duration)
    done: dict[Run, Result] = {}
    for run, result in on_cluster(wanted) if cluster else on_cores(wanted):
        done[run] = result
        note(f'{len(done)} of {len(wanted)} runs')
    return done


def attempt(run: Run) -> Result:
    """Return what happened in a run, or why it has failed: the others have taken minutes."""
    try:
        return simulate(run)
    except Exception as error:
        return RunFailed(f'{type(error).__name__}: {error}')


def on_cores(runs: Sequence[Run], cores: int | None = None) -> Iterator[tuple[Run, Result]]:
    """Yield each run and its result, as they come."""
    return each_on_cores(attempt, runs, cores)


def each_on_cores(
    work: Callable[[Task], Done], tasks: Sequence[Task], cores: int | None = None
) -> Iterator[tuple[Task, Done]]:
    """Yield each task and what `work` returns of it, as they come."""
    spawning = multiprocessing.get_context('spawn')
    cores = cores or len(os.sched_getaffinity(0))
    with ProcessPoolExecutor(
        max_workers=cores, mp_context=spawning, initializer=end_with_parent
    ) as pool:
        futures = {pool.submit(work, task): task for task in tasks}
        for future in as_completed(futures):
            yield futures[future], future.result()


def all_on_cores(work: Callable[[Task], Done], tasks: Sequence[Task]) -> list[Done]:
    """Return what `work` returns of each task, in their order."""
    done = dict(each_on_cores(work, tasks))
    return [done[task] for task in tasks]


def on_cluster(runs: Sequence[Run]) -> Iterator[tuple[Run, Result]]:
    """
    Yield each run and its result, as they come from the cluster.

    Its workers need this version of wasd; the benchmark's own files are sent to them.
    """
    # Here, because only who has such a cluster has installed it (extra `cluster`).
    from distributed import as_completed as completed
    from distributed import Client

    with Client(cluster) as client:
        for name in SENT:
            client.upload_file(str(HERE / f'{name}.py'))
        futures: Iterable[Any] = client.map(attempt, runs, pure=False)
        named = dict(zip(futures, runs, strict=True))
        for future in completed(list(named)):
            yield named[future], future.result()
