# SPDX-License-Identifier: Apache-2.0
"""What a user may have meant by a name that does not exist."""

from collections.abc import Sequence
import difflib

# So many names are listed where none is near.
LISTED = 12


def suggest(name: str, known: Sequence[str]) -> str:
    """Return '; did you mean ...?' for an unknown name, or which names there are."""
    if not known:
        return ''
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.7)
    # A name in another namespace is as near as a typing error.
    last = name.rpartition('/')[2]
    near += [other for other in known if other.rpartition('/')[2] == last and other not in near]
    if near:
        return f'; did you mean {" or ".join(near[:3])}?'
    listed = ', '.join(known[:LISTED])
    return f'; there are {listed}{", ..." if len(known) > LISTED else ""}'
