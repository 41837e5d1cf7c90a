# SPDX-License-Identifier: Apache-2.0
"""Differential drive controller: limits, wheel commands, odometry."""
