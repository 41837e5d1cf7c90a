# SPDX-License-Identifier: Apache-2.0
"""Leg controller of a four-legged robot: states, gait, estimator, convex MPC, whole-body QP."""
