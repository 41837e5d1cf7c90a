# SPDX-License-Identifier: Apache-2.0
"""Differential drive controller: limits, wheel commands, odometry."""

from wasd_core import quiet_start

quiet_start(__name__, 'diff_drive_controller')

# How wheels are driven: a PID loop, the integer loop of the ArbotiX board, no physics.
MODES = ('float', 'arbotix', 'fake')
