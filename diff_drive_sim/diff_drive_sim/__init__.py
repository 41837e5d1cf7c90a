# SPDX-License-Identifier: Apache-2.0
"""Differential drive controller: limits, wheel commands, odometry."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'diff_drive_controller')

# How wheels are driven: a PID loop, the integer loop of the ArbotiX board, no physics.
MODES = ('float', 'arbotix', 'fake')
# Public names by module; it is loaded for the first of them, as ROS takes a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'controller_file': 'read_controller_file',
        'diff_drive_controller_node': 'DiffDriveControllerNode',
        'drive': 'DiffDrive DiffDriveController',
        'odometry': 'DiffDriveError DiffDriveGeometry WheelOdometry find_wheels',
        'parameters': 'DiffDriveParameters',
    },
)
__all__ += ['MODES']
