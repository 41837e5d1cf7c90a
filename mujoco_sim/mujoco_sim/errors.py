# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""

from robot_description.errors import UserError


class SimulationError(UserError):
    """The simulation cannot do what was asked; the text is one line."""
