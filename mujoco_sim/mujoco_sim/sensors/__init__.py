# SPDX-License-Identifier: Apache-2.0
"""Sensors of a robot: their tags in a URDF, where they are mounted, what they measure."""
