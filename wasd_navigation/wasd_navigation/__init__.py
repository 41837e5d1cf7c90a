# SPDX-License-Identifier: Apache-2.0
"""Map the surroundings with a planar lidar, localise in a map, drive to a point."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'navigator', 'guard')

# Where each name is defined; loaded when it is asked for, as numba takes a while.
_HOMES = {
    'DriveLimits': 'parameters',
    'Driver': 'planning.driver',
    'Footprint': 'parameters',
    'Grid': 'records',
    'Localizer': 'mapping.localizer',
    'Mapper': 'mapping.mapper',
    'MappingParameters': 'parameters',
    'PlanningParameters': 'parameters',
    'Scan': 'records',
    'load_map': 'mapping',
    'read_scan': 'records',
    'save_map': 'mapping',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
