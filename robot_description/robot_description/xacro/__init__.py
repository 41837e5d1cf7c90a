# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""

from robot_description.xacro.session import expand, expand_document, Expansion, XacroSession

__all__ = ['Expansion', 'XacroSession', 'expand', 'expand_document']
