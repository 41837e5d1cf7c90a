# SPDX-License-Identifier: Apache-2.0
"""What kind of robot a tree is, whatever its links and joints are called."""

from robot_description.drive_wheels import drive_wheels
from robot_description.leg import NotAQuadruped
from robot_description.quadruped import find_quadruped
from robot_description.urdf import Robot

QUADRUPED = 'quadruped'
DIFF_DRIVE = 'diff-drive'
OTHER = 'other'


def kind_of(robot: Robot) -> str:
    """Return `quadruped`, `diff-drive` for two coaxial wheels, or `other`."""
    try:
        find_quadruped(robot)
    except NotAQuadruped:
        return DIFF_DRIVE if len(drive_wheels(robot)) == 2 else OTHER
    return QUADRUPED
