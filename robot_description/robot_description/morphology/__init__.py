# SPDX-License-Identifier: Apache-2.0
"""What a robot is by its shape: a quadruped with its legs, or two driven wheels."""
