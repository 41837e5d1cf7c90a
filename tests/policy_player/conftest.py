# SPDX-License-Identifier: Apache-2.0
"""Looks at networks in this process: ours are no strangers', and each look would be a process."""

from pathlib import Path
from typing import Any

import pytest

# Whose tests are of that look.
LOOKERS = ('test_strangers_files', 'test_ours')
_found: dict[tuple[bytes, int], dict[str, Any]] = {}


@pytest.fixture(autouse=True)
def looks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at files of equal bytes once, and here."""
    if request.path.stem in LOOKERS:
        return
    from policy_player import first_look

    def look_once(path: Path, width: int) -> dict[str, Any]:
        key = path.read_bytes(), width
        if key not in _found:
            _found[key] = first_look.describe(first_look.open_session(str(path)), width)
        return _found[key]

    monkeypatch.setattr(first_look, 'look', look_once)
