# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import numpy as np
import pytest
from quadruped_sim.algebra import flatten, plain
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import find_landing, keep_apart
from quadruped_sim.robot_state import BaseMotion
from quadruped_sim.tuning import FootholdParameters, ReferenceParameters
from wasd_core.rotations import yaw_matrix

STANCE = 0.2


@pytest.fixture
def land(rules):
    """Footholds of a Go2 on level ground at z 0; keywords replace standing still at the origin."""
    ground = Ground()
    schedule = GaitState(np.zeros(4, dtype=bool), np.ones(4), STANCE, 0.2, pace=0.0)

    def land(velocity=(0, 0, 0), command=None, yaw=0.0, yaw_rate=0.0, firmness=0.0):
        velocity = np.array(velocity, dtype=float)
        command = velocity if command is None else np.array(command, dtype=float)
        rpy = np.array((0.0, 0.0, yaw))
        base = BaseMotion(np.zeros(3), velocity, yaw_matrix(yaw), rpy, np.zeros(3))
        reference = BaseReference(np.zeros(3), rpy, command, yaw_rate)
        feet = np.zeros((4, 3))
        robot = flatten({'base': base, 'feet': feet})
        asked = (plain(schedule), plain(reference), firmness)
        find_landing(rules, robot, ground.flat, asked, feet)
        return feet

    land.nominal = rules['nominal'][0]
    return land


def test_standing_still_the_feet_land_below_the_hips(land):
    """Their centres a radius above the ground, and where a foot without load touches."""
    wanted = land.nominal + (0.0, 0.0, 0.022 + 0.003)
    np.testing.assert_allclose(land(), wanted, atol=1e-12)


@pytest.mark.parametrize(
    'speed, above', [(0.5, 0.005), (2.0, 0.005), (-1.0, 0.005), (0.1, 0.0035)]
)
def test_who_walks_sets_feet_down_more_softly(land, speed, above):
    """They aim higher; below 0.45 m/s in proportion, for in place that makes a robot stray."""
    heights = land((speed, 0.0, 0.0))[:, 2] - 0.022
    np.testing.assert_allclose(heights, above, atol=1e-4)


def test_firmly_they_aim_into_the_ground(land):
    np.testing.assert_allclose(land(firmness=1.0)[:, 2], 0.022 - 0.004, atol=1e-12)


def test_moving_they_land_half_a_stance_ahead(land):
    shift = land((0.6, -0.2, 0.0)) - land()
    np.testing.assert_allclose(shift[:, :2], np.tile((0.06, -0.02), (4, 1)), atol=1e-12)


def test_faster_than_commanded_they_land_farther_ahead(land):
    pushed = land((0.0, 0.5, 0.0), command=(0.0, 0.0, 0.0))
    assert (pushed[:, 1] > land((0.0, 0.5, 0.0))[:, 1]).all()


def test_turning_they_lead_by_half_a_stance(land):
    turned = land(yaw=0.3, yaw_rate=1.0)
    wanted = land.nominal @ yaw_matrix(0.3 + 0.5 * STANCE).T
    np.testing.assert_allclose(turned[:, :2], wanted[:, :2], atol=1e-12)


def test_the_shift_has_a_limit(land):
    shift = land((50.0, 0.0, 0.0)) - land()
    np.testing.assert_allclose(shift[:, 0], FootholdParameters().reach, atol=1e-12)


def test_in_a_curve_they_land_where_the_way_leads_and_farther_out(land):
    """
    The middle of a stance on a circle is under the hips, but for what the bend would topple.

    Out of the circle by h/g v^2/r, as the weight and the force to the middle then point to the
    centre of mass.
    """
    speed, rate, height = 1.0, 2.0, ReferenceParameters().height
    feet = land((speed, 0.0, 0.0), yaw_rate=rate).mean(axis=0)
    radius, turned = speed / rate, rate * 0.5 * STANCE
    out = height / 9.81 * speed * rate
    wanted = np.array((np.sin(turned), -np.cos(turned))) * (radius + out) + (0.0, radius)
    np.testing.assert_allclose(feet[:2], wanted, atol=2e-4)


@for_all('yaw', [0.0, 2.0])
def test_a_foot_does_not_land_across_the_one_that_stands_beside_it(yaw):
    turn = yaw_matrix(yaw)
    feet = np.array(((0.2, 0.0, 0), (0.2, -0.1, 0), (-0.2, 0.1, 0), (-0.2, -0.1, 0))) @ turn.T
    wanted = feet + turn @ (0.0, 0.15, 0.0)
    landing = wanted.copy()
    keep_apart(landing, feet, np.array((True, False, False, True)), yaw, 0.08)
    np.testing.assert_allclose((landing[1] - feet[0]) @ turn[:, 1], -0.08, atol=1e-12)
    np.testing.assert_array_equal(landing[[0, 2, 3]], wanted[[0, 2, 3]])
