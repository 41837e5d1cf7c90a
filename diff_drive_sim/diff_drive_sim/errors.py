# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""


class DiffDriveError(ValueError):
    """The diff-drive controller cannot do what was asked; the text is one line."""
