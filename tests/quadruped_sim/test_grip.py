# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import leg_stages
import numpy as np
import pytest
from quadruped_sim.estimation.grip import Grip
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.rules import flat_rules
from quadruped_sim.tuning import GripParameters, MpcParameters

TICK = 0.002
GUESS = 0.4
PARAMETERS = GripParameters()


def feel(state, grip, ratio, slip=0.0, seconds=0.2, stands=(True,) * 4):
    """Forces of this ratio, tangential to normal, on feet that slip at so much; base axes."""
    R = state.base.R
    forces = np.tile((0.6 * ratio, 0.8 * ratio, 1.0), (4, 1)) * 60.0
    base = replace_velocity(state, -slip * np.array((0.6, 0.8, 0.0)))
    felt = replace(state, forces=forces @ R, base=base)
    for _ in range(round(seconds / TICK)):
        leg_stages.grip(grip, felt, np.array(stands), np.eye(3), grip.rules, TICK)
    return grip.friction


def replace_velocity(state, velocity):
    return state.base._replace(velocity=velocity, omega=np.zeros(3))


@pytest.fixture
def make(model):
    """Return what makes a grip of a guess, with the rules that it goes by."""

    def make(guess):
        grip = Grip(guess)
        params = LegControllerParameters(mpc=MpcParameters(friction=guess))
        grip.rules = flat_rules(params, model)
        return grip

    return make


@pytest.fixture
def grip(make):
    return make(GUESS)


@pytest.fixture
def rest(robot_state):
    return replace(robot_state, joint_velocity=np.zeros(12))


def test_feet_that_slip_tell_the_friction(rest, grip):
    friction = feel(rest, grip, ratio=0.2, slip=0.5)
    assert friction == pytest.approx(0.2 * PARAMETERS.share, rel=1e-3)
    assert grip.share == pytest.approx(friction / GUESS)


def test_feet_that_bear_more_without_slipping_raise_it(rest, grip):
    assert feel(rest, grip, ratio=0.6) == pytest.approx(GUESS + 0.2 * PARAMETERS.rise)
    assert feel(rest, grip, ratio=0.6, seconds=5.0) == PARAMETERS.most
    assert grip.share == 1.0


def test_feet_that_bear_little_say_nothing(rest, grip):
    assert feel(rest, grip, ratio=0.1) == GUESS
    assert feel(rest, grip, ratio=0.0, slip=0.5, stands=(False,) * 4) == GUESS


def test_a_foot_that_does_not_move_against_its_force_is_landing(rest, grip):
    assert feel(rest, grip, ratio=0.2, slip=-0.5) == GUESS


@pytest.mark.parametrize('guess', [0.9, 0.05])
def test_a_guess_beyond_what_is_believed_in_else_stays(rest, make, guess):
    grip = make(guess)
    assert feel(rest, grip, ratio=0.0) == guess
    assert feel(rest, grip, ratio=0.5 * guess, slip=0.5) < max(guess, PARAMETERS.least)


def test_it_is_never_below_what_a_robot_can_stand_on(rest, grip):
    assert feel(rest, grip, ratio=0.01, slip=0.5) == PARAMETERS.least
    grip.reset()
    assert grip.friction == GUESS
