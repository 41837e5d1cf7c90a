# SPDX-License-Identifier: Apache-2.0
"""The types of ROS, as rosbags knows them."""

import functools
from typing import Any

from rosbags.typesys import get_typestore, Stores


@functools.cache
def store() -> Any:
    """Return them; to load them takes half a second."""
    return get_typestore(Stores.ROS2_JAZZY)
