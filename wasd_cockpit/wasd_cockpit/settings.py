# SPDX-License-Identifier: Apache-2.0
"""What a driver has chosen on the page, kept from run to run."""

from collections.abc import Mapping
import contextlib
import json
import logging
import os
from pathlib import Path
from typing import Any

# More than this is no file of ours.
LARGEST = 100_000
_LOG = logging.getLogger(__name__)


def usual_path(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return where settings are kept, None where there is no home."""
    home = environment.get('XDG_CONFIG_HOME') or ''
    if not os.path.isabs(home):
        user = environment.get('HOME') or ''
        if not os.path.isabs(user):
            return None
        home = os.path.join(user, '.config')
    return Path(home) / 'wasd' / 'cockpit.json'


def load(path: Path | None) -> dict[str, Any]:
    """Return what was kept; nothing where there is no file, or one that is broken."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        if path is not None and path.stat().st_size <= LARGEST:
            found = json.loads(path.read_text())
            if isinstance(found, dict):
                return found
    return {}


def save(path: Path | None, settings: dict[str, Any]) -> None:
    """Keep settings; where they cannot be kept that is said once, and nothing else happens."""
    if path is None:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f'.{os.getpid()}')
        part.write_text(json.dumps(settings, indent=1))
        part.replace(path)
    except OSError as error:
        _LOG.warning('the cockpit forgets how it was set up: %s', error)
