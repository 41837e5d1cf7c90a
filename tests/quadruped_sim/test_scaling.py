# SPDX-License-Identifier: Apache-2.0
"""Parameters of a robot of the Go2's shape are the Go2's, each grown by its unit."""

from dataclasses import fields
import math

from cases import for_all
import pytest
from quadruped_sim.command_filter import velocity_limits
from quadruped_sim.parameters import (
    LegControllerParameters,
    NOT_SCALED,
    scale_parameters,
    WEIGHT_UNITS,
)
from robot_description.morphology.quadruped import GO2, Scale
from wasd_core.parameters import InvalidParameter

PARAMETERS = LegControllerParameters()


def test_the_go2s_parameters_stay_as_they_are():
    assert scale_parameters(PARAMETERS, GO2) == PARAMETERS


@for_all('length', [0.7, 1.6])
def test_a_similar_robot_moves_alike(length):
    """Of the same stuff: mass grows with the cube of length."""
    mass, root = length**3, math.sqrt(length)
    other = scale_parameters(PARAMETERS, Scale(length, mass))
    gait, mpc = other.gait, other.mpc
    assert gait.slow_period == pytest.approx(0.45 * root)
    assert gait.slow_speed == pytest.approx(0.4 * root)
    assert gait.slow_duty == 0.55
    assert gait.step_height == pytest.approx(0.05 * length)
    assert other.reference.height == pytest.approx(0.30 * length)
    assert other.foothold.velocity_gain == pytest.approx(0.04 * root)
    assert mpc.force_max == pytest.approx(260.0 * mass)
    assert mpc.step == pytest.approx(0.025 * root)
    assert mpc.steps == 12
    assert other.contact.force_on == pytest.approx(25.0 * mass)
    assert other.whole_body.swing_kp == pytest.approx(10.0 * mass * length)
    assert other.balance.acceleration_max == pytest.approx(5.0)
    assert other.safety.tilt_max == PARAMETERS.safety.tilt_max


def test_the_wire_has_no_size():
    assert scale_parameters(PARAMETERS, Scale(2.0, 8.0)).command.timeout == 0.5


@for_all('error', [('rad', 0), ('m', 3), ('m', 5)])
def test_errors_that_are_alike_cost_the_same(error):
    """So that the forces of the MPC on a similar robot are the Go2's times its mass."""
    unit, index = error
    scale = Scale(1.6, 4.0)
    weight = scale_parameters(PARAMETERS, scale).mpc.pose_weights[index]
    assert weight * scale.of(unit) ** 2 == pytest.approx(PARAMETERS.mpc.pose_weights[index])
    force = scale_parameters(PARAMETERS, scale).mpc.force_weight
    assert force * scale.of('N') ** 2 == pytest.approx(PARAMETERS.mpc.force_weight)


def test_every_number_has_a_unit_a_weight_or_a_reason():
    """A new parameter in metres without its unit would stay the Go2's on every robot."""
    scale = Scale(2.0, 3.0)
    for group in fields(PARAMETERS):
        for field in fields(getattr(PARAMETERS, group.name)):
            unit = field.metadata['unit']
            if unit and field.name not in NOT_SCALED:
                assert scale.of(unit) > 0.0
            elif isinstance(field.default, tuple):
                assert len(WEIGHT_UNITS[field.name]) == len(field.default)


def test_slippery_feet_push_and_speed_up_less():
    wet = scale_parameters(PARAMETERS, GO2, friction=0.2)
    assert wet.mpc.friction == pytest.approx(0.16)
    assert wet.command.forward_acceleration == pytest.approx(0.4 * 0.2 * 9.81)
    assert scale_parameters(PARAMETERS, GO2, friction=0.6) == PARAMETERS


@pytest.mark.parametrize(
    ('lowered', 'said'),
    [({'friction': 0.0}, 'friction must be > 0'), ({'motor_speed': 0.0}, 'step_height must be >')],
)
def test_what_a_description_lowers_to_nothing_is_refused(lowered, said):
    with pytest.raises(InvalidParameter, match=said):
        scale_parameters(PARAMETERS, GO2, **lowered)


def test_slow_motors_lift_the_feet_lower():
    gaits = [
        scale_parameters(PARAMETERS, GO2, motor_speed=share).gait for share in (1.0, 0.5, 0.1)
    ]
    assert [gait.step_height for gait in gaits] == pytest.approx([0.05, 0.05, 0.01])
    assert [gait.rough_step_height for gait in gaits] == pytest.approx([0.14, 0.14, 0.028])


def test_speed_limits_grow_by_froude_and_shrink_with_slow_motors():
    sport = velocity_limits('sport', Scale(2.25, 10.0))
    assert (sport.forward, sport.yaw) == pytest.approx((3.0, 2.0 / 1.5))
    assert velocity_limits('sport', GO2, agility=0.5).forward == 1.0
    assert velocity_limits('sport', GO2, agility=0.5, turning=0.5).yaw == 0.5
    assert velocity_limits('guide', Scale(2.25, 10.0)).forward == 0.4
    assert velocity_limits('guide', Scale(0.1, 0.001), agility=0.5).forward < 0.4
