# SPDX-License-Identifier: Apache-2.0
"""A robot as a MuJoCo model: tree, masses, shapes, contacts; and what renders it."""

from robot_description.mujoco.renderer import (
    begin_drawing,
    check_renderer,
    choose_renderer,
    find_renderer,
    NO_RENDERER,
    why_no_renderer,
)

__all__ = [
    'NO_RENDERER',
    'begin_drawing',
    'check_renderer',
    'choose_renderer',
    'find_renderer',
    'why_no_renderer',
]
