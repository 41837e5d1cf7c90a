# SPDX-License-Identifier: Apache-2.0
"""What of robot and floor the controller is not told; it loads neither numpy nor MuJoCo."""

from dataclasses import dataclass
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
    base carries.
    """

    friction: float | None = None
    payload: Payload | None = None
