# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""

from wasd_core.errors import UserError


class DiffDriveError(UserError):
    """The diff-drive controller cannot do what was asked; the text is one line."""
