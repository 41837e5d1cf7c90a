# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""

from wasd_core.errors import UserError


class SimulationError(UserError):
    """The simulation cannot do what was asked; the text is one line."""
