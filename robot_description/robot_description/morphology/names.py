# SPDX-License-Identifier: Apache-2.0
"""What names of joints and links say: sides, and which of several names was meant."""

from collections.abc import Collection
import difflib
from functools import lru_cache
import re

# Words and leg codes, and the sides they stand for.
SIDES = {
    word: tuple(names.split())
    for names, words_for in {
        'left': 'left',
        'right': 'right',
        'front': 'front fore',
        'back': 'back rear hind',
        'front left': 'fl lf',
        'front right': 'fr rf',
        'back left': 'rl hl lh',
        'back right': 'rr hr rh',
    }.items()
    for word in words_for.split()
}
# Single letters mean a side at wheels, as in base_l_wheel_joint; elsewhere `r` may be `roll`.
LETTERS = {'l': ('left',), 'r': ('right',)}
# Words that tell nothing about which of a robot's joints it is.
FILLERS = {'base', 'joint', 'link'}
OPPOSITE = {'left': 'right', 'right': 'left', 'front': 'back', 'back': 'front'}
LEAST_LIKENESS = 0.8
# More names than a robot has; comparing their spelling would take long.
MOST_KNOWN = 300


def words(name: str) -> list[str]:
    """Return the words of a name in lower case: `FL_hipJoint2` has fl, hip, joint, 2."""
    return [w.lower() for w in re.findall(r'[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+', name)]


@lru_cache(maxsize=10_000)
def sides(name: str) -> frozenset[str]:
    """Return what a name says of `left`, `right`, `front` and `back`."""
    parts = words(name)
    table = SIDES | LETTERS if 'wheel' in parts else SIDES
    return frozenset(side for part in parts for side in table.get(part, ()))


@lru_cache(maxsize=10_000)
def part(name: str) -> tuple[str, ...]:
    """Return a name's words without its sides: what it is, wherever it is."""
    parts = words(name)
    table = SIDES | LETTERS if 'wheel' in parts else SIDES
    return tuple(word for word in parts if word not in table)


def guess_name(name: str, known: Collection[str]) -> str | None:
    """
    Return the one name among `known` that was probably meant, or None.

    Names of the same part and sides count first: `base_l_wheel_joint` is `left_wheel_joint`; then
    names that are spelled alike and have the same sides.
    """
    what = set(part(name)) - FILLERS
    same = [
        other
        for other in known
        if sides(other) == sides(name) and set(part(other)) - FILLERS == what
    ]
    if same:
        return same[0] if len(same) == 1 else None
    if len(known) > MOST_KNOWN:
        return None
    alike = [other for other in known if sides(other) == sides(name)]
    close = difflib.get_close_matches(name, alike, n=2, cutoff=LEAST_LIKENESS)
    return close[0] if len(close) == 1 else None


def hint_at(name: str, known: Collection[str]) -> str:
    """Return '; ... is', to be put behind `... is not there`, or nothing."""
    probably = guess_name(name, known)
    return f'; {probably!r} is' if probably else ''


def unknown_joint_warning(name: str, known: Collection[str]) -> str:
    """Return what to say about a joint of `joint_states` that a description does not have."""
    probably = guess_name(name, known)
    hint = f'rename it to {probably!r}' if probably else f'it has {", ".join(known) or "none"}'
    return f'joint {name!r} of joint_states is not in the description; {hint}'
