# SPDX-License-Identifier: Apache-2.0
"""An experiment: runs, and how they are judged; each becomes one row."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

from table import format_count, Row
from trials import Run, RunFailed, Trace

# Nobody tuned with the seeds from here on.
FIRST_SEED = 1000
Trial = dict[str, Any]


def seeds(count: int) -> range:
    """Return so many acceptance seeds."""
    return range(FIRST_SEED, FIRST_SEED + count)


class Verdict(NamedTuple):
    """What was measured in an experiment, whether that is good enough, and each trial."""

    measured: str
    passed: bool
    trials: Sequence[Trial]


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Runs that are done once each, whoever else wants the same, and their judge."""

    what: str
    must: str
    runs: Sequence[Run]
    judge: Callable[[Sequence[Trace]], Verdict]
    anchor: str = '-'

    def row(self, results: Mapping[Run, Trace | RunFailed]) -> Row:
        """Return the row; a run that failed fails it."""
        traces: list[Trace] = []
        for run in self.runs:
            result = results[run]
            if isinstance(result, RunFailed):
                return self._row(Verdict(f'seed {run.seed} broke: {result}', False, ()))
            traces.append(result)
        return self._row(self.judge(traces))

    def _row(self, verdict: Verdict) -> Row:
        return Row(
            what=self.what,
            measured=verdict.measured,
            must=self.must,
            passed=verdict.passed,
            anchor=self.anchor,
            trials=verdict.trials,
        )


def judged(
    what: str,
    must: str,
    runs: Sequence[Run],
    trial: Callable[[Trace], Trial],
    say: Callable[[list[Trial]], str] = lambda _: '',
    *,
    share: float | None = 1.0,
    anchor: str = '-',
) -> Experiment:
    """
    Return an experiment of trials that pass each by itself, a share of them at least.

    `trial` returns the values of one run with `passed`, `say` what is told of all of them. With
    None for a share all must pass, and nobody counts.
    """
    needed = math.ceil((1.0 if share is None else share) * len(runs) - 1e-9)

    def judge(traces: Sequence[Trace]) -> Verdict:
        trials = [trace.record(**trial(trace)) for trace in traces]
        passed, measured = sum(found['passed'] for found in trials), say(trials)
        if share is not None:
            measured = f'{format_count(passed, len(trials))}, {measured}'.removesuffix(', ')
        return Verdict(measured, passed >= needed, trials)

    must = must if share is None else f'{must}: >= {needed} of {len(runs)}'
    return Experiment(what=what, must=must, runs=runs, judge=judge, anchor=anchor)


def worst(trials: Sequence[Trial], name: str) -> float:
    """Return the largest of a value."""
    return max(float(trial[name]) for trial in trials)
