# SPDX-License-Identifier: Apache-2.0
"""Errors of this package."""


class SimulationError(ValueError):
    """The simulation cannot do what was asked; the text is one line."""
