# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'wasd')

# Public names by module; it is loaded for the first of them, as simulator and ROS take a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'cli': 'main make_parser',
        'cli.options': 'read_options',
        'robots': 'ROBOTS RobotRow',
        'run.options': 'RunOptions',
        'run.robot': 'Robot',
        'run.run': 'Run',
    },
)
