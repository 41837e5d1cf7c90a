# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""

from wasd_core.errors import UserError


class UsageError(UserError):
    """The command line or a file it names is wrong; the text is one line: what, got, wanted."""


class NotFound(UserError):
    """A topic, service, node or parameter is not there; the text says what is."""


class RecordingError(UserError):
    """A recording cannot be written or read; the text is one line with its path."""
