# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""
