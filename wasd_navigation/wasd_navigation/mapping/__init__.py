# SPDX-License-Identifier: Apache-2.0
"""Maps from scans, the robot's place in them, and their files."""

from wasd_navigation.mapping.map_file import load_map, map_outputs, save_map, without_ending
from wasd_navigation.mapping.session import load_session, save_session, session_output

__all__ = [
    'load_map',
    'load_session',
    'map_outputs',
    'save_map',
    'save_session',
    'session_output',
    'without_ending',
]
