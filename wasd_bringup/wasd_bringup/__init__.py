# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'wasd')

# Where each name is defined; loaded when it is asked for, as simulator and ROS take a while.
_HOMES = {
    'ROBOTS': 'robots',
    'RobotRow': 'robots',
    'Robot': 'run.robot',
    'Run': 'run.run',
    'RunOptions': 'run.options',
    'main': 'cli',
    'make_parser': 'cli',
    'read_options': 'cli.options',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
