# SPDX-License-Identifier: Apache-2.0
"""The project's own robots, each expanded and read once for all tests of a process."""

import functools

from robot_description.description import Description, load_robot


@functools.cache
def robot_named(name: str) -> Description:
    """Return a robot's description, which nothing changes."""
    return load_robot(name)
