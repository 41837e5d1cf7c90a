# SPDX-License-Identifier: Apache-2.0
"""Walking: gait, footholds, swing feet, MPC forces and whole-body torques put together."""

from quadruped_sim.locomotion.locomotion import Locomotion

__all__ = ['Locomotion']
