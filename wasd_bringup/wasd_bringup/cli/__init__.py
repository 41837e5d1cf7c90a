# SPDX-License-Identifier: Apache-2.0
"""The `wasd` command."""

from wasd_bringup.cli.main import main, make_parser

__all__ = ['main', 'make_parser']
