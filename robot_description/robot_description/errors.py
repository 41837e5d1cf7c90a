# SPDX-License-Identifier: Apache-2.0
"""Errors of this package, and the root of every error that is the user's to mend."""


class UserError(ValueError):
    """Something given to the program is wrong; the text is one line: what, got, wanted, where."""


class DescriptionError(UserError):
    """A robot description cannot be used; the text is one line that says what and where."""


class PackageNotFound(DescriptionError, LookupError):
    """No package of that name is known here."""
