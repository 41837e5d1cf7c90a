# SPDX-License-Identifier: Apache-2.0
"""An experiment: runs, and how they are judged; each becomes one row."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from table import Row
from trials import Run
from trials import RunFailed
from trials import Trace


class Verdict(NamedTuple):
    """What was measured in an experiment, whether that is good enough, and each trial."""

    measured: str
    passed: bool
    trials: Sequence[dict[str, Any]]


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
