# SPDX-License-Identifier: Apache-2.0
"""Sensors: their tags in a URDF, what they measure, how that is published."""
