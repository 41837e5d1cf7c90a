# SPDX-License-Identifier: Apache-2.0
"""Map the surroundings with a planar lidar, localise in a map, drive to a point."""

from wasd_core import quiet_start

quiet_start(__name__, 'navigator', 'guard')
