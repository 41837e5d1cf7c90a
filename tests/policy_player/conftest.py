# SPDX-License-Identifier: Apache-2.0
"""Remembers looks at networks: each is a process, and tests read the same few again and again."""

from pathlib import Path
from typing import Any

import pytest

# Whose tests are of that look.
LOOKERS = ('test_strangers_files', 'test_ours')
_found: dict[tuple[bytes, int], dict[str, Any]] = {}


@pytest.fixture(autouse=True)
def looks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at files of equal bytes once."""
    if request.path.stem in LOOKERS:
        return
    from policy_player import first_look

    look = first_look.look

    def look_once(path: Path, width: int) -> dict[str, Any]:
        key = path.read_bytes(), width
        if key not in _found:
            _found[key] = look(path, width)
        return _found[key]

    monkeypatch.setattr(first_look, 'look', look_once)
