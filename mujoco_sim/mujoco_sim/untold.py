# SPDX-License-Identifier: Apache-2.0
"""What of robot and floor the controller is not told; it loads neither numpy nor MuJoCo."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from typing import NamedTuple


class Payload(NamedTuple):
    """A load of a mass [kg] with its centre at `place` [m] in the base's frame, welded on."""

    mass: float
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Untold:
    """
    What a run changes behind the controller's back.

    `friction` is what its feet have on any ground, or of a robot without feet all that it touches
    the ground with, wheels too; without one it is what the description says. `payload` is what the
    base carries. `imu_drift` is how many times the usual an IMU drifts that has noise. `randomise`
    is how much a quadruped differs from its description at random, 0 to
    1.
    """

    friction: float | None = None
    payload: Payload | None = None
    randomise: float = 0.0
    imu_drift: float = 1.0


NOTHING = Untold()


@dataclass(frozen=True)
class Drawn:
    """
    How a robot differs from its description.

    `mass` [kg] is added to its base, whose centre of mass moves by `centre` [m]; commands and
    readings come later by their delays [s], `noise` is a factor. A motor's torque is what it was
    told times its `strength`. Without `friction` its feet have their own.
    """

    mass: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float | None = None
    command_delay: float = 0.0
    sensor_delay: float = 0.0
    noise: float = 1.0
    strength: Mapping[str, float] = field(default_factory=dict)
