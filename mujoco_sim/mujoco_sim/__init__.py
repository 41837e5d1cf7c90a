# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, services, viewer."""
