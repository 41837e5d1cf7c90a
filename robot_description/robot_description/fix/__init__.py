# SPDX-License-Identifier: Apache-2.0
"""Mends what can be mended in a description, in its text; nothing is written but on request."""

from robot_description.fix.mending import FIXES, mend, write_mended

__all__ = ['FIXES', 'mend', 'write_mended']
