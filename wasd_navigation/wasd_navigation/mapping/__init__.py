# SPDX-License-Identifier: Apache-2.0
"""
Maps as Nav2's map_server reads and writes them: a YAML file and a PGM picture.

The picture's first row is the grid's last. Trinary: black is occupied, nearly white free, grey
unknown.
"""

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
