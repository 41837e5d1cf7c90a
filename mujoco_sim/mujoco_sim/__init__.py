# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, sensors, services, viewers."""

from wasd_core import quiet_start

quiet_start(__name__, 'simulator')

import robot_description.mujoco  # noqa: E402, F401  it prepares the import of mujoco
