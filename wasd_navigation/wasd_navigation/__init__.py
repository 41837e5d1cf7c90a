# SPDX-License-Identifier: Apache-2.0
"""Map the surroundings with a planar lidar, localise in a map, drive to a point."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'navigator', 'guard')

# Public names by module; it is loaded for the first of them, as numba takes a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'mapping': 'load_map save_map',
        'mapping.localizer': 'Localizer',
        'mapping.mapper': 'Mapper',
        'parameters': 'DriveLimits Footprint MappingParameters PlanningParameters',
        'planning.driver': 'Driver',
        'records': 'Grid Scan read_scan',
    },
)
