# SPDX-License-Identifier: Apache-2.0
"""How high feet are lifted, and the nose: by what the ground has felt like."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.estimation.contacts import height_at
from quadruped_sim.parameters import ContactParameters
from quadruped_sim.parameters import GaitParameters
from quadruped_sim.presets import GAITS
from quadruped_sim.robot_model import RobotModel

# Feet that stand this far off the plane through all are the noise of a flat floor, and this far
# off are on rough ground, in full; on the Go2 [m].
_FLAT, _ROUGH = 0.012, 0.035
# Part of a swing in which a force is a stumble: before, the foot leaves; after, it lands.
_MID_SWING = (0.15, 0.85)
# How far the nose is up on rough ground [rad]: while fore feet look for the top of a first high
# stair, the chin, ahead of them, arrives at the second.
_NOSE = 0.08


class StepRule(NamedTuple):
    """
    A force that is a stumble [N], flat and rough [m], what of the roughness a tick leaves.

    Steps have a height on flat ground, and so much more on rough [m], where the nose is so far up
    [rad].
    """

    force: float
    flat: float
    rough: float
    left: float
    height: float
    higher: float
    nose: float


class StepHeight:
    """
    Steps are low on flat ground, high after a stumble [Focchi2013] or where footholds are uneven;
    there the nose is up, too.

    State: how rough the ground is, from 0 to 1. It is felt at once and forgotten slowly.
    """

    def __init__(self, params: GaitParameters, contact: ContactParameters, model: RobotModel):
        self._scale = model.scale.of('m')
        self.flat = np.zeros(1)
        self.tune(params, contact)
        self.reset()

    def tune(self, params: GaitParameters, contact: ContactParameters) -> None:
        """Take other heights and another threshold of force."""
        self._params, self._force = params, contact.force_on
        higher = params.rough_step_height - params.step_height
        share = GAITS[params.name].rough
        self._more = share * higher, share * _NOSE

    def reset(self) -> None:
        """Expect flat ground."""
        self.flat[0] = 0.0

    @property
    def roughness(self) -> float:
        """How rough the ground is, from 0 to 1."""
        return float(self.flat[0])

    def rule(self, dt: float) -> StepRule:
        """Return how the ground is felt in ticks of `dt` [s]."""
        params, scale = self._params, self._scale
        left = math.exp(-dt / params.terrain_time)
        limits = self._force, _FLAT * scale, _ROUGH * scale
        return StepRule(*limits, left, params.step_height, *self._more)


@jit
def find_step_height(
    robot: np.ndarray,
    ground: np.ndarray,
    legs: tuple[np.ndarray, np.ndarray],
    points: np.ndarray,
    own: np.ndarray,
    rule: StepRule,
) -> float:
    """Advance the roughness `own` (1,) by a tick; return the height of a step [m]."""
    limits = rule.force, rule.flat, rule.rough
    own[0] = max(own[0] * rule.left, _feel_steps(robot, ground, legs, points, limits))
    return float(rule.height + own[0] * rule.higher)


@jit
def _feel_steps(
    robot: np.ndarray,
    ground: np.ndarray,
    legs: tuple[np.ndarray, np.ndarray],
    points: np.ndarray,
    limits: tuple[float, float, float],
) -> float:
    """
    Return how rough the ground is felt to be now: in full by a foot that meets something.

    `legs` are which stand by schedule, and their phases; `limits` a force [N], flat and rough [m].
    """
    state, plane = robot[0], ground[0]
    is_stance, phase = legs
    force, flat, rough = limits
    off = 0.0
    for i in range(4):
        if not is_stance[i] and _MID_SWING[0] < phase[i] < _MID_SWING[1]:
            for k in range(3):
                if abs(state.forces[i, k]) > force:
                    return 1.0
        if state.is_contact[i]:
            level = height_at(plane, points[i, 0], points[i, 1])
            off = max(off, abs(points[i, 2] - level))
    return min(max((off - flat) / (rough - flat), 0.0), 1.0)
