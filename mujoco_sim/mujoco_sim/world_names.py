# SPDX-License-Identifier: Apache-2.0
"""The worlds that have names."""

WORLD_NAMES = 'flat, room, slope:DEG, stairs:RISE, step:HEIGHT, boxes:HEIGHT, rough:HEIGHT'
