# SPDX-License-Identifier: Apache-2.0
"""Errors of all packages, and the words in which they are told: one line, and what was meant."""

from collections.abc import Callable, Sequence
import difflib


class UserError(ValueError):
    """Something given to the program is wrong; the text is one line: what, got, wanted, where."""


class Stopped(Exception):
    """A stop signal came while something was made that takes its time."""


class InvalidMessage(UserError):
    """A message says something that cannot be; the text is one line."""


class DescriptionError(UserError):
    """A robot description cannot be used; the text is one line that says what and where."""


class PackageNotFound(DescriptionError, LookupError):
    """No package of that name is known here."""


def attempt_all(*acts: Callable[[], object]) -> None:
    """
    Do one after the other, also when one has failed.

    Raises:
        UserError: what has failed; of several, one line each, as `error: ...` shows them.
        Exception: the first that failed otherwise, a bug or Ctrl-C.
    """
    failures: list[UserError] = []
    other: BaseException | None = None
    for act in acts:
        try:
            act()
        except UserError as error:
            failures.append(error)
        except BaseException as error:
            other = other or error
    if other is not None:
        raise other
    if len(failures) == 1:
        raise failures[0]
    if failures:
        raise UserError('\nerror: '.join(map(str, failures)))


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
