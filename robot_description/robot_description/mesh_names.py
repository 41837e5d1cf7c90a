# SPDX-License-Identifier: Apache-2.0
"""Which mesh was meant when a name is wrong: aliases of the trunk, then likeness."""

from collections.abc import Collection
import difflib
from pathlib import Path
import re

# Words for the part that carries the legs or wheels; robots are rebuilt, references stay.
ALIASES = {'trunk': 'base', 'body': 'base', 'base_link': 'base', 'base': 'base'}
# Words that tell parts of one robot apart however alike their names are.
SIDES = {
    *('fl', 'fr', 'rl', 'rr', 'hl', 'hr', 'lf', 'rf', 'lh', 'rh', 'lr', 'bl', 'br', 'l', 'r'),
    *('left', 'right', 'front', 'rear', 'hind', 'back', 'upper', 'lower', 'mirror', 'inner'),
    *('outer', 'top', 'bottom'),
}
# difflib's ratio; thigh and thigh1 have 0.91, calf and calf_mirror 0.53, thigh and shank 0.2.
LEAST_LIKENESS = 0.75


def near_name(missing: str, unused: Collection[Path], carries: bool) -> tuple[Path, ...]:
    """
    Return the files among `unused` that a missing stem may mean: one is an answer.

    `carries` says that the link is the root or welded to it; then aliases of it count first.
    """
    if carries:
        wanted = _without_alias(missing)
        aliases = [path for path in unused if _without_alias(path.stem) == wanted]
        if aliases:
            return tuple(aliases)
    return tuple(path for path in unused if _likeness(missing, path.stem) >= LEAST_LIKENESS)


def _without_alias(stem: str) -> str:
    words = re.sub(r'base[_\- ]link', 'base', stem.lower())
    return '_'.join(ALIASES.get(word, word) for word in re.split(r'[_\-. ]+', words))


def _likeness(one: str, other: str) -> float:
    """Return how alike two names are, 0 to 1; 0 when they differ in a side or a number."""
    if _marks(one) != _marks(other):
        return 0.0
    return difflib.SequenceMatcher(None, one.lower(), other.lower()).ratio()


def _marks(stem: str) -> list[str]:
    words = re.findall(r'[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+', stem)
    return sorted(word.lower() for word in words if word.lower() in SIDES or word.isdigit())
