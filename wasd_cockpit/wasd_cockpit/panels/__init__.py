# SPDX-License-Identifier: Apache-2.0
"""What panels are drawn from, and what a panel is."""

from wasd_cockpit.panels.page_panel import PagePanel, PageState

__all__ = ['PagePanel', 'PageState']
