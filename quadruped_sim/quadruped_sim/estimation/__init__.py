# SPDX-License-Identifier: Apache-2.0
"""Which feet touch, by joint torques alone, the plane on which they stand, and their grip."""

from quadruped_sim.estimation.grip import feel_grip, Grip, GripRule
from quadruped_sim.estimation.ground import follow_plane, Ground, height_at, Plane, PlaneFilter
from quadruped_sim.estimation.touch import ContactDetector, feel_touch, find_touch

__all__ = [
    'ContactDetector',
    'Grip',
    'GripRule',
    'Ground',
    'Plane',
    'PlaneFilter',
    'feel_grip',
    'feel_touch',
    'find_touch',
    'follow_plane',
    'height_at',
]
