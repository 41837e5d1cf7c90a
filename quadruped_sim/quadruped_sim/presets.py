# SPDX-License-Identifier: Apache-2.0
"""Choices by name: gaits, and speeds at full stick; for the Go2."""

from typing import NamedTuple


class VelocityLimits(NamedTuple):
    """Largest commanded speeds: forward, backward, sideways [m/s] and turning [rad/s]."""

    forward: float
    backward: float
    lateral: float
    yaw: float

    def hold(self, vx: float, vy: float, yaw_rate: float) -> bool:
        """Whether a velocity [m/s, m/s, rad/s] is within them."""
        ahead = -self.backward <= vx <= self.forward
        return ahead and abs(vy) <= self.lateral and abs(yaw_rate) <= self.yaw


# unitree_guide's; what the controller is good for on any ground; what it can do on a good floor.
LIMITS = {
    'guide': VelocityLimits(0.4, 0.4, 0.3, 0.5),
    'sport': VelocityLimits(2.0, 1.5, 0.8, 2.0),
    'race': VelocityLimits(3.0, 2.0, 1.5, 5.0),
}


class GaitRow(NamedTuple):
    """
    A gait: how it differs from a trot.

    `offsets` say how far ahead of FL each foot begins to stand, FL FR RL RR, in shares of the
    period, `period` is that of a trot's, `longer` the share of it that
    a foot stands beyond what the parameters say, `footprint` the length and width between the
    feet as shares of those between the hips; `slim` says which of the two are a Go2's, for its
    size, on a longer or wider robot: feet of one end, or one side, that bear it alone tip it over
    the more, the farther they are from its middle. The command is kept within `limits`, each by
    itself, and within the ellipsoid `able`, all at once: half axes ahead, sideways [m/s], turning
    [rad/s], tried by benchmarks/gait_limits.py. It ramps at the share `agility` of a trot's
    accelerations; steps grow on rough ground by the share `rough`.
    """

    offsets: tuple[float, float, float, float]
    limits: VelocityLimits
    able: tuple[float, float, float]
    period: float = 1.0
    longer: float = 0.0
    footprint: tuple[float, float] = (1.0, 1.0)
    slim: tuple[bool, bool] = (False, False)
    agility: float = 1.0
    rough: float = 1.0


# A row is a gait that can be chosen.
GAITS = {
    # diagonal pairs together
    'trot': GaitRow((0.0, 0.5, 0.5, 0.0), LIMITS['race'], able=(3.0, 1.5, 5.0)),
    # one foot after the other
    'walk': GaitRow(
        (0.0, 0.5, 0.75, 0.25),
        VelocityLimits(1.0, 0.75, 0.4, 1.0),
        able=(1.75, 0.7, 1.75),
        period=1.5,
        longer=0.21,
        slim=(False, True),
    ),
    # left pair and right pair
    'pace': GaitRow(
        (0.0, 0.5, 0.0, 0.5),
        VelocityLimits(1.0, 0.6, 0.3, 1.0),
        able=(1.75, 0.52, 1.75),
        period=0.75,
        footprint=(1.0, 0.4),
        slim=(False, True),
    ),
    # front pair and rear pair
    'bound': GaitRow(
        (0.0, 0.0, 0.5, 0.5),
        VelocityLimits(1.15, 0.6, 0.3, 1.0),
        able=(1.95, 0.42, 1.4),
        period=0.65,
        longer=0.03,
        footprint=(0.9, 1.0),
        slim=(True, False),
        agility=0.35,
    ),
    # all at once
    'pronk': GaitRow(
        (0.0, 0.0, 0.0, 0.0),
        VelocityLimits(1.1, 0.6, 0.0, 1.0),
        able=(1.9, 1.0, 1.8),
        period=0.65,
    ),
    # rear feet, then front feet, one of each pair first; the inner two nearly together, so that
    # the pairs of feet that bear it lie across, and nothing pitches or rolls
    'gallop': GaitRow(
        (0.0, 0.3, 0.36, 0.66),
        VelocityLimits(2.5, 0.8, 0.4, 1.2),
        able=(2.8, 0.45, 1.35),
        period=0.85,
        footprint=(0.9, 0.5),
        slim=(True, True),
        agility=0.5,
        # What meets a foot at such a speed feels like a stumble, and high steps make it one.
        rough=0.0,
    ),
}
