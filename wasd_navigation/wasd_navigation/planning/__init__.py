# SPDX-License-Identifier: Apache-2.0
"""The way to a goal and along it: distances, goal field, sampled motions, recovery."""
