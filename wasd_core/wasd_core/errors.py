# SPDX-License-Identifier: Apache-2.0
"""Errors of all packages, and their texts: one line, with suggestions."""

from collections.abc import Callable, Iterable
import difflib


class UserError(ValueError):
    """Something given to the program is wrong; the text is one line: what, got, wanted, where."""


class Stopped(Exception):
    """A stop signal came during a long construction."""


class InvalidMessage(UserError):
    """A message has impossible content; the text is one line."""


class DescriptionError(UserError):
    """A robot description cannot be used; the text is one line that says what and where."""


class PackageNotFound(DescriptionError, LookupError):
    """No package of that name is known here."""


class RobotModelError(UserError):
    """The description is not a robot that legs can walk; says what is missing or odd."""


class SimulationError(UserError):
    """The simulation cannot carry out a request; the text is one line."""


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


# So many names are said to be meant, and listed where none is near.
MEANT = 3
LISTED = 12


def one_line(error: BaseException) -> str:
    """Return what an error says in one line: of one of the system's its reason, without number."""
    text = getattr(error, 'strerror', None) or error
    return ' '.join(str(text).split()) or type(error).__name__


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ', did you mean ...?' for an unknown name, or '' where no known one is near."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1)
    # A name in another namespace is as near as a typing error.
    last = name.rpartition('/')[2]
    near += [other for other in known if other.rpartition('/')[2] == last and other not in near]
    return f', did you mean {" or ".join(near[:MEANT])}?' if near else ''


def suggest(name: str, known: Iterable[str]) -> str:
    """Return the same, or which names there are."""
    known = list(known)
    listed = ', '.join(known[:LISTED]) + (', ...' if len(known) > LISTED else '')
    return did_you_mean(name, known) or (f'; known: {listed}' if known else '')
