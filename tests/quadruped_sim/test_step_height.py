# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math

import leg_stages
import numpy as np
import pytest
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.footwork import StepHeight
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.rules import flat_rules

TICK = 0.002
PARAMETERS = LegControllerParameters()
LOW, HIGH = PARAMETERS.gait.step_height, PARAMETERS.gait.rough_step_height
FEET = np.array(((0.2, 0.1, 0.0), (0.2, -0.1, 0.0), (-0.2, 0.1, 0.0), (-0.2, -0.1, 0.0)))


class Walk:
    """Step heights of a Go2 whose FL is in mid swing over level ground at z 0."""

    def __init__(self, model, state, rules):
        self.height, self.rules = StepHeight(), rules
        self.ground = Ground()
        self._state = state

    def step(self, *args, **kwargs):
        """Return the height of a step [m]."""
        return self.feel(*args, **kwargs)[0]

    def nose(self):
        """Return how far it is up after no time [rad]."""
        return self.feel(dt=0.0)[1]

    def feel(self, phase=0.5, force=0.0, raised=0.0, dt=TICK):
        forces = np.zeros((4, 3))
        forces[0, 0] = -force
        stands = np.array((False, True, True, True))
        points = FEET + np.outer((0, 1, 0, 0), (0, 0, raised))
        state = replace(self._state, forces=forces, is_contact=stands)
        schedule = GaitState(stands, np.full(4, phase), 0.2, 0.2, 0.0)
        place = self.ground, points
        return leg_stages.height(self.height, state, schedule, place, self.rules, dt)


@pytest.fixture
def walk(model, robot_state, rules):
    return Walk(model, robot_state, rules)


def test_on_flat_ground_steps_are_low(walk):
    assert walk.step(raised=0.01) == LOW


def test_a_foot_that_hits_something_in_mid_swing_lifts_the_next_ones(walk):
    assert walk.step(force=40.0) == pytest.approx(HIGH)
    assert walk.step() == pytest.approx(HIGH, rel=0.01)


@pytest.mark.parametrize('phase', [0.05, 0.95])
def test_leaving_and_landing_are_no_stumble(walk, phase):
    assert walk.step(phase, force=40.0) == LOW


def test_the_more_uneven_the_footholds_the_higher_the_steps(walk):
    heights = [walk.step(raised=raised, dt=1e6) for raised in (0.01, 0.02, 0.03, 0.05, 0.1)]
    assert heights == sorted(heights)
    assert heights[0] == LOW
    assert heights[-1] == pytest.approx(HIGH)


@pytest.mark.slow
def test_rough_ground_is_forgotten_in_its_time(walk):
    walk.step(force=40.0)
    for _ in range(round(PARAMETERS.gait.terrain_time / TICK)):
        height = walk.step()
    assert (height - LOW) / (HIGH - LOW) == pytest.approx(math.exp(-1.0), rel=1e-3)


def test_where_it_is_rough_the_trunk_is_higher(walk):
    walk.step()
    assert walk.height.raised(walk.rules) == 0.0
    walk.step(force=40.0)
    assert walk.height.raised(walk.rules) == pytest.approx(0.03)


def test_after_a_reset_flat_ground_is_expected(walk):
    walk.step(force=40.0)
    walk.height.reset()
    assert walk.step() == LOW


def test_after_a_stumble_the_nose_is_up_until_the_ground_is_forgotten(walk):
    walk.step()
    assert walk.nose() == 0.0
    walk.step(force=40.0)
    up = walk.nose()
    assert 0.05 < up < 0.15
    walk.step(dt=PARAMETERS.gait.terrain_time)
    assert walk.nose() == pytest.approx(up * math.exp(-1.0))


def test_a_gallop_is_too_fast_for_high_steps_and_keeps_its_nose_down(model, walk):
    gait = replace(PARAMETERS.gait, name='gallop')
    walk.rules = flat_rules(replace(PARAMETERS, gait=gait), model)
    assert walk.step(force=40.0) == LOW
    assert walk.height.raised(walk.rules) == walk.nose() == 0.0
