# SPDX-License-Identifier: Apache-2.0
"""The cockpit in the browser: it shows a run and takes orders from its driver."""

from wasd_core import load_lazily

# Public names by module; it is loaded for the first of them, as MuJoCo takes a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'cockpit': 'Cockpit',
        'link': 'Link Snapshot',
    },
)
