# SPDX-License-Identifier: Apache-2.0
"""Loads libraries without looking for garbage among them."""

from collections.abc import Iterator
import contextlib
import gc


@contextlib.contextmanager
def loading(is_ours: bool = True) -> Iterator[None]:
    """
    Context of a start: Python looks for no garbage in what is loaded meanwhile.

    Nothing of it is any, and Python would go through all of it again and again: a tenth of the
    processor time of a start. `is_ours` is whether the process is, so that what it has loaded is
    not looked through later, either.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        # Once: what a later run leaves is garbage.
        if is_ours and was_enabled and gc.get_freeze_count() == 0:
            gc.freeze()
        if was_enabled:
            gc.enable()
