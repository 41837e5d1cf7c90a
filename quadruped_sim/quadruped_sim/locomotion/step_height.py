# SPDX-License-Identifier: Apache-2.0
"""How high the feet are lifted: by what the ground has felt like."""

import math

import numpy as np

from quadruped_sim.estimation.contacts import Ground
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.parameters import ContactParameters
from quadruped_sim.parameters import GaitParameters
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState

# Feet that stand this far off the plane through all are the noise of a flat floor, and this far
# off are on rough ground, in full; on the Go2 [m].
_FLAT, _ROUGH = 0.012, 0.035
# Part of a swing in which a force is a stumble: before, the foot leaves; after, it lands.
_MID_SWING = (0.15, 0.85)


class StepHeight:
    """
    Steps are low on flat ground, high after a stumble [Focchi2013] or where footholds are uneven.

    State: how rough the ground is, from 0 to 1. It is felt at once and forgotten slowly.
    """

    def __init__(self, params: GaitParameters, contact: ContactParameters, model: RobotModel):
        self._scale = model.scale.of('m')
        self.tune(params, contact)
        self.reset()

    def tune(self, params: GaitParameters, contact: ContactParameters) -> None:
        """Take other heights and another threshold of force."""
        self._params, self._force = params, contact.force_on

    def reset(self) -> None:
        """Expect flat ground."""
        self.roughness = 0.0

    def step(
        self, state: RobotState, schedule: GaitState, points: np.ndarray, ground: Ground, dt: float
    ) -> float:
        """
        Height of a step [m] after `dt` [s].

        `points` (4, 3) are where the feet touch or would touch, world axes [m].
        """
        params = self._params
        felt = 1.0 if self._stumbles(state, schedule) else self._unevenness(state, points, ground)
        self.roughness = max(self.roughness * math.exp(-dt / params.terrain_time), felt)
        return params.step_height + self.roughness * (
            params.rough_step_height - params.step_height
        )

    def _stumbles(self, state: RobotState, schedule: GaitState) -> bool:
        """Whether a foot meets something on its way. Plain numbers: numpy takes far longer."""
        begin, end = _MID_SWING
        legs = zip(schedule.is_stance.tolist(), schedule.phase.tolist(), strict=True)
        swings = [
            leg for leg, (stands, phase) in enumerate(legs) if not stands and begin < phase < end
        ]
        return any(max(map(abs, state.forces[leg].tolist())) > self._force for leg in swings)

    def _unevenness(self, state: RobotState, points: np.ndarray, ground: Ground) -> float:
        heights = zip(points[:, 2].tolist(), ground.heights(points).tolist(), strict=True)
        touching = zip(state.is_contact.tolist(), heights, strict=True)
        off = max(
            (abs(foot - plane) for touches, (foot, plane) in touching if touches), default=0.0
        )
        flat, rough = _FLAT * self._scale, _ROUGH * self._scale
        return min(max((off - flat) / (rough - flat), 0.0), 1.0)
