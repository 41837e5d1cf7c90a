# SPDX-License-Identifier: Apache-2.0
"""From where a robot is seen."""

from typing import NamedTuple


class CameraView(NamedTuple):
    """A camera that follows a body: distance [m], angles [degrees] as MuJoCo has them."""

    distance: float
    azimuth: float
    elevation: float
