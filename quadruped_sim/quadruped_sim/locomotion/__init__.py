# SPDX-License-Identifier: Apache-2.0
"""The trot: gait, reference, swing feet, MPC of the forces, whole-body QP, feedback."""
