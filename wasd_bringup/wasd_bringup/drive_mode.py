# SPDX-License-Identifier: Apache-2.0
"""Which mode the drive of a wheeled robot is to have, by the command line and its file."""

from diff_drive_sim.controller_file import read_controller_file

from wasd_bringup.options import RunOptions


def drive_mode(options: RunOptions) -> str | None:
    """
    Return the mode that the command line asks for; None: the file's, or the default.

    `sim` is whichever loop the file asks for, as long as there is one.

    Raises:
        InvalidParameter: what is wrong with the file.
    """
    if options.mode != 'sim':
        return options.mode
    return 'float' if _mode_of_file(options) == 'fake' else None


def is_fake(options: RunOptions) -> bool:
    """
    Whether the robot is to move without physics.

    Raises:
        InvalidParameter: what is wrong with the file.
    """
    return (options.mode or _mode_of_file(options)) == 'fake'


def _mode_of_file(options: RunOptions) -> str | None:
    if options.controller is None or options.robot == 'go2':
        return None  # legs have no mode
    mode = read_controller_file(str(options.controller)).values.get('mode')
    return str(mode) if mode is not None else None
