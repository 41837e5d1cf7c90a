# SPDX-License-Identifier: Apache-2.0
"""Differential drive controller: limits, wheel commands, odometry."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'diff_drive_controller')

# How wheels are driven: a PID loop, the integer loop of the ArbotiX board, no physics.
MODES = ('float', 'arbotix', 'fake')
# Where each name is defined; loaded when it is asked for, as ROS takes a while.
_HOMES = {
    'DiffDrive': 'drive',
    'DiffDriveController': 'controller',
    'DiffDriveControllerNode': 'diff_drive_controller_node',
    'DiffDriveError': 'odometry',
    'DiffDriveGeometry': 'odometry',
    'DiffDriveParameters': 'parameters',
    'WheelOdometry': 'odometry',
    'find_wheels': 'odometry',
    'read_controller_file': 'controller_file',
}
__all__ = ['MODES', *_HOMES]  # noqa: PLE0604
__getattr__ = load_lazily(__name__, _HOMES)
