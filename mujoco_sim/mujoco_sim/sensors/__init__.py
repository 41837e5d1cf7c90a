# SPDX-License-Identifier: Apache-2.0
"""What sensors share: their tags in a URDF, where they are mounted, and the site they are on."""

from mujoco_sim.sensors.mount import Site, Snapshot
from mujoco_sim.sensors.tags import SensorTag

__all__ = ['SensorTag', 'Site', 'Snapshot']
