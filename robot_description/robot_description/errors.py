# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""


class DescriptionError(ValueError):
    """A robot description cannot be used; the text is one line that says what and where."""


class PackageNotFound(DescriptionError, LookupError):
    """No package of that name is known here."""
