# SPDX-License-Identifier: Apache-2.0
"""Planar lidars that are sold: what they measure and how they err, a row each."""

from typing import NamedTuple


class LidarModel(NamedTuple):
    """
    A lidar that turns and measures ray after ray.

    The standard deviation of a range is `noise` [m], or `noise_share` of the range where that is
    more. A ray is lost, and tells of nothing, with the probability `dropouts`.
    """

    rate: float  # revolutions in a second [Hz]
    samples: int  # in a whole revolution
    min_range: float  # [m]
    max_range: float  # [m]
    noise: float
    noise_share: float
    dropouts: float


# Rates, samples and ranges are of the data sheets. So is the noise: what they call accuracy or
# precision is taken for one deviation (A1, of which users measure as much) or two. No sheet
# speaks of lost rays: those are our guess.
LIDAR_MODELS = {
    'a1': LidarModel(5.5, 360, 0.15, 6.0, 0.005, 0.01, 0.01),  # Slamtec RPLIDAR A1M8-R1
    'lds': LidarModel(5.0, 360, 0.12, 3.5, 0.005, 0.0175, 0.01),  # Robotis LDS-01
    's2': LidarModel(10.0, 3200, 0.05, 30.0, 0.015, 0.0, 0.002),  # Slamtec RPLIDAR S2
}
