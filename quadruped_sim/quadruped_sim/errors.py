# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""

from wasd_core.errors import UserError


class RobotModelError(UserError):
    """The description is not a robot this controller can walk; says what is missing or odd."""
