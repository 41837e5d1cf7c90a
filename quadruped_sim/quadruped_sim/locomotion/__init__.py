# SPDX-License-Identifier: Apache-2.0
"""Walking: gait, footholds, swing feet, MPC forces and whole-body torques put together."""
