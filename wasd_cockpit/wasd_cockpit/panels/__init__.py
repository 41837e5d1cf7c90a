# SPDX-License-Identifier: Apache-2.0
"""The base class of panels, and their data."""

from wasd_cockpit.panels.page_panel import PagePanel, PageState

__all__ = ['PagePanel', 'PageState']
