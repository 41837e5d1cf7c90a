# SPDX-License-Identifier: Apache-2.0
"""Leg controller of a four-legged robot: states, gait, estimator, convex MPC, whole-body QP."""

from wasd_core import quiet_start

quiet_start(__name__, 'leg_controller')
