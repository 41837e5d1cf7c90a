# SPDX-License-Identifier: Apache-2.0
"""The cockpit in the browser: it shows a run and takes orders from its driver."""

from wasd_core import load_lazily

# Where each name is defined; loaded when it is asked for, as MuJoCo takes a while.
_HOMES = {
    'Cockpit': 'cockpit',
    'Link': 'link',
    'Snapshot': 'link',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
