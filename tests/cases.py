# SPDX-License-Identifier: Apache-2.0
"""
One test for many cases of one sentence, where pytest's own parametrize would make a test of each.

For cases that take next to nothing each: with thousands of them, what surrounds a test costs more
than the test.
"""

from collections.abc import Callable, Iterable, Sequence
import contextlib
import copy
import functools
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest


def for_all(names: str | Sequence[str], cases: Iterable[Any]) -> Callable[..., Any]:
    """
    Call a test with each of `cases` as `names`; fail with each case that fails, by its values.

    `monkeypatch`, `tmp_path`, `capsys`, `caplog` and generators of random numbers are as new for
    each case; all other fixtures are the same for all of them.
    """
    known = [name.strip() for name in names.split(',')] if isinstance(names, str) else list(names)
    # Once, as cases may come from an iterator.
    rows = [tuple(case) if len(known) > 1 else (case,) for case in cases]
    if not rows:
        raise ValueError(f'no case of {", ".join(known)}')

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(test)
        others = [each for name, each in signature.parameters.items() if name not in known]

        @functools.wraps(test)
        def test_of_all(**fixtures: Any) -> None:
            failures = []
            for number, row in enumerate(rows):
                case = dict(zip(known, row, strict=True))
                try:
                    with _anew(fixtures, number) as fresh:
                        test(**fresh, **case)
                except (Exception, pytest.fail.Exception) as failure:
                    shown = ', '.join(f'{name}={value!r:.160}' for name, value in case.items())
                    failure.add_note(f'case: {shown}')
                    failures.append(failure)
            if len(failures) == 1:
                raise failures[0]
            if failures:
                raise BaseExceptionGroup(f'{len(failures)} of {len(rows)} cases', failures)

        test_of_all.__signature__ = signature.replace(parameters=others)  # type: ignore[attr-defined]
        return test_of_all

    return decorate


@contextlib.contextmanager
def _anew(fixtures: dict[str, Any], number: int) -> Any:
    """Context whose fixtures have nothing of the case before."""
    fresh = {
        name: copy.deepcopy(value) if isinstance(value, np.random.Generator) else value
        for name, value in fixtures.items()
    }
    with contextlib.ExitStack() as stack:
        if 'monkeypatch' in fresh:
            fresh['monkeypatch'] = stack.enter_context(fresh['monkeypatch'].context())
        if 'tmp_path' in fresh:
            folder: Path = fresh['tmp_path'] / f'case{number}'
            folder.mkdir()
            fresh['tmp_path'] = folder
        if 'capsys' in fresh:
            fresh['capsys'].readouterr()
        if 'caplog' in fresh:
            fresh['caplog'].clear()
        yield fresh
