# SPDX-License-Identifier: Apache-2.0
"""Goals, ways to them, and velocities along these."""
