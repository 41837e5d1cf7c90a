# SPDX-License-Identifier: Apache-2.0
"""The robots that come with the project, by name."""

import os
from pathlib import Path

from wasd_core.errors import DescriptionError

from robot_description.packages import share_directory

DESCRIPTIONS = {
    'go2': 'urdf/go2/go2.urdf.xacro',
    'mbot': 'urdf/mbot/mbot.urdf.xacro',
    'mbot_bare': 'urdf/mbot/mbot_bare.urdf.xacro',
    'mbot_kinect': 'urdf/mbot/mbot_kinect.urdf.xacro',
}


def description_path(name_or_path: str) -> Path:
    """
    Return the description of a built-in robot, or the path itself when something is there.

    Raises:
        DescriptionError: when it is neither; lists the names.
    """
    if name_or_path in DESCRIPTIONS:
        return share_directory('robot_description') / DESCRIPTIONS[name_or_path]
    path = Path(name_or_path)
    if os.path.lexists(path):
        return path
    raise DescriptionError(
        f'{name_or_path}: no such file, and no robot of that name; '
        f'robots: {", ".join(sorted(DESCRIPTIONS))}'
    )
