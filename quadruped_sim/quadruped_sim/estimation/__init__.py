# SPDX-License-Identifier: Apache-2.0
"""What the robot knows of itself: base by a Kalman filter, feet that touch, ground under them."""
