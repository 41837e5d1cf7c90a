# SPDX-License-Identifier: Apache-2.0
"""Units tell how a quantity grows; poses on robots of one shape are the same."""

from dataclasses import replace
import math

from cases import for_all
from descriptions import robot_named
import numpy as np
import pytest
from robot_description.morphology.quadruped import (
    find_quadruped,
    FOLDED,
    GO2,
    Quadruped,
    Scale,
    scale_of,
    similar_pose,
    STOP_MARGIN,
)
from robot_description.urdf import parse_urdf


@pytest.fixture(scope='module')
def go2() -> Quadruped:
    return find_quadruped(parse_urdf(robot_named('go2').urdf))


def resized(robot: Quadruped, length: float) -> Quadruped:
    """Return a robot with all lengths multiplied, and mass as of the same stuff."""
    legs = tuple(
        replace(
            leg, hip=length * leg.hip, offset=length * leg.offset,
            thigh=length * leg.thigh, calf=length * leg.calf,
        )
        for leg in robot.legs
    )  # fmt: skip
    return replace(robot, legs=legs, mass=robot.mass * length**3)


@for_all(
    ('unit', 'factor'),
    [
        ('m', 4.0), ('s', 2.0), ('m/s', 2.0), ('m/s^2', 1.0), ('1/s', 0.5), ('rad/s', 0.5),
        ('1/s^2', 0.25), ('rad/s^2', 0.25), ('N', 64.0), ('N m', 256.0), ('N m/rad', 256.0),
        ('N m s/rad', 512.0), ('kg m^2', 1024.0), ('1/N^2', 1 / 4096), ('rad', 1.0), ('1', 1.0),
    ],
)  # fmt: skip
def test_a_unit_tells_how_a_quantity_grows(unit: str, factor: float) -> None:
    """A robot four times as long and, of the same stuff, 64 times as heavy."""
    assert Scale(4.0, 64.0).of(unit) == pytest.approx(factor)
    assert GO2.of(unit) == 1.0


def test_energy_by_force_and_by_motion_is_one() -> None:
    scale = Scale(1.7, 3.1)
    assert scale.of('N m') == pytest.approx(scale.of('kg m^2/s^2'))


def test_an_unknown_unit_is_an_error() -> None:
    with pytest.raises(ValueError, match='furlong'):
        Scale().of('furlong/s')


@pytest.mark.slow
def test_the_go2_is_the_measure(go2: Quadruped) -> None:
    assert scale_of(go2) == GO2
    larger = scale_of(resized(go2, 1.5))
    assert (larger.length, larger.mass) == pytest.approx((1.5, 3.375))


@pytest.mark.slow
@pytest.mark.parametrize('pose', [FOLDED, (0.67, -1.3)])
@pytest.mark.parametrize('length', [0.7, 1.0, 1.5])
def test_a_robot_of_the_same_shape_has_the_same_pose(
    go2: Quadruped, pose: tuple[float, float], length: float
) -> None:
    wanted = np.tile((0.0, *pose), 4)
    angles = similar_pose(resized(go2, length), *pose)
    np.testing.assert_allclose(angles, wanted, atol=0.0 if length == 1.0 else 1e-9)


def feet(robot: Quadruped, angles: np.ndarray) -> np.ndarray:
    """Return height and place ahead of the hip of each foot, shape (4, 2) [m]."""
    places = []
    for leg, (_, thigh, calf) in zip(robot.legs, angles.reshape(4, 3).tolist(), strict=True):
        down = leg.thigh * math.cos(thigh) + leg.calf * math.cos(thigh + calf) + leg.drop
        back = leg.thigh * math.sin(thigh) + leg.calf * math.sin(thigh + calf)
        places.append((float(leg.hip[2]) - down, -back))
    return np.array(places)


def test_legs_divided_otherwise_put_the_feet_to_the_same_places(go2: Quadruped) -> None:
    front, rear = {'thigh': 0.19, 'calf': 0.236}, {'thigh': 0.24, 'calf': 0.17, 'drop': 0.016}
    legs = tuple(replace(leg, **(front, front, rear, rear)[i]) for i, leg in enumerate(go2.legs))
    other = replace(go2, legs=legs)
    wanted = feet(go2, similar_pose(go2, 0.67, -1.3))
    np.testing.assert_allclose(feet(other, similar_pose(other, 0.67, -1.3)), wanted, atol=1e-9)


def test_knees_that_point_forward_get_the_mirror_image(go2: Quadruped) -> None:
    legs = tuple(replace(leg, bend=-1.0, lower=-leg.upper, upper=-leg.lower) for leg in go2.legs)
    angles = similar_pose(replace(go2, legs=legs), 0.67, -1.3)
    np.testing.assert_array_equal(angles, np.tile((0.0, -0.67, 1.3), 4))


def test_a_knee_that_stops_early_leaves_the_foot_below_the_same_line(go2: Quadruped) -> None:
    legs = tuple(replace(leg, lower=np.array((-1.0, -1.0, -2.0))) for leg in go2.legs)
    stiff = replace(go2, legs=legs)
    angles = similar_pose(stiff, *FOLDED)
    np.testing.assert_allclose(angles[2::3], -2.0 + STOP_MARGIN)
    lying, folded = feet(stiff, angles), feet(go2, similar_pose(go2, *FOLDED))
    assert (lying[:, 0] < folded[:, 0] - 0.05).all()
    np.testing.assert_allclose(lying[:, 1] / lying[:, 0], folded[:, 1] / folded[:, 0])
