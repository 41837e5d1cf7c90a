# SPDX-License-Identifier: Apache-2.0
"""Which library renders pictures without a display; to be asked before mujoco is imported."""

import ctypes.util
import os

NO_RENDERER = 'no EGL or OSMesa library (Debian, Ubuntu: apt install libegl1 libosmesa6)'
# MUJOCO_GL's word for each library, the faster one first.
_LIBRARIES = {'EGL': 'egl', 'OSMesa': 'osmesa'}
_OFF = ('disable', 'disabled', 'off', 'false', '0')


def choose_renderer() -> bool:
    """
    Set MUJOCO_GL to what this machine has, unless the user has set it; return whether it has any.

    mujoco reads the variable once, when it is imported for the first time.
    """
    if 'MUJOCO_GL' in os.environ:
        return os.environ['MUJOCO_GL'].lower() not in _OFF
    for library, name in _LIBRARIES.items():
        if ctypes.util.find_library(library):
            os.environ['MUJOCO_GL'] = name
            return True
    return False
