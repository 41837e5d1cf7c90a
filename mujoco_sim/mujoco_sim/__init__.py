# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, services, viewer."""

from wasd_core import quiet_start

quiet_start(__name__, 'simulator')
