# SPDX-License-Identifier: Apache-2.0
"""Errors of all packages, and the root of every one that is the user's to mend."""

from collections.abc import Callable


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
