# SPDX-License-Identifier: Apache-2.0
"""Differential drive controller: limits, wheel commands, odometry."""

from wasd_core import quiet_start

quiet_start(__name__, 'diff_drive_controller')
