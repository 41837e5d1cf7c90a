# SPDX-License-Identifier: Apache-2.0
import numpy as np
from quadruped_sim.algebra import plain
from quadruped_sim.leg_kinematics import all_leg_angles, foot_positions, leg_motion, solve_leg

STEP = 1e-6


def some_angles(rng):
    return np.tile((0.0, 0.8, -1.6), 4) + rng.uniform(-0.4, 0.4, 12)


def test_closed_form_feet_are_those_of_pinocchio(model, rng):
    for _ in range(20):
        angles = some_angles(rng)
        feet = foot_positions(model.geometry, angles)
        np.testing.assert_allclose(feet, model.foot_positions(angles), atol=1e-9)


def test_inverse_undoes_forward(model, rng):
    for _ in range(50):
        angles = some_angles(rng)
        feet = foot_positions(model.geometry, angles)
        np.testing.assert_allclose(all_leg_angles(model.geometry, feet), angles, atol=1e-7)


def test_foot_jacobian_matches_central_differences(model, angles):
    J = leg_motion(model.geometry, angles, np.zeros(12)).jacobian
    for leg in range(4):
        for joint in range(3):
            shift = np.zeros(12)
            shift[3 * leg + joint] = STEP
            ahead = foot_positions(model.geometry, angles + shift)[leg]
            behind = foot_positions(model.geometry, angles - shift)[leg]
            difference = (ahead - behind) / (2.0 * STEP)
            np.testing.assert_allclose(J[leg, :, joint], difference, atol=1e-8)


def test_foot_velocity_and_bias_match_central_differences(model, angles, rng):
    rates = rng.normal(size=12)
    motion = leg_motion(model.geometry, angles, rates)
    ahead = leg_motion(model.geometry, angles + STEP * rates, rates)
    behind = leg_motion(model.geometry, angles - STEP * rates, rates)
    difference = (ahead.position - behind.position) / (2.0 * STEP)
    np.testing.assert_allclose(motion.velocity, difference, atol=1e-8)
    difference = (ahead.velocity - behind.velocity) / (2.0 * STEP)
    np.testing.assert_allclose(motion.bias, difference, atol=1e-7)


def test_contact_point_moves_as_a_point_of_the_calf(model, angles, rng, contact_points):
    rates = rng.normal(size=12)
    motion = leg_motion(model.geometry, angles, rates)
    normal = np.array((0.1, -0.2, 1.0)) / np.linalg.norm((0.1, -0.2, 1.0))
    contact = contact_points(motion, normal, 0.022)
    for leg in range(4):
        arm = contact.position[leg] - motion.position[leg]
        wanted = motion.velocity[leg] + np.cross(motion.calf_rate[leg], arm)
        np.testing.assert_allclose(
            contact.jacobian[leg] @ rates[3 * leg : 3 * leg + 3], wanted, atol=1e-12
        )


def test_left_and_right_legs_are_mirror_images(model):
    feet = foot_positions(model.geometry, np.tile((0.2, 0.7, -1.4, -0.2, 0.7, -1.4), 2))
    np.testing.assert_allclose(feet[0] * (1, -1, 1), feet[1], atol=1e-12)
    np.testing.assert_allclose(feet[2] * (1, -1, 1), feet[3], atol=1e-12)


def test_out_of_reach_foot_is_brought_to_the_sphere_and_reported(model):
    leg = model.geometry
    far = leg.hip[0] + np.array((0.0, leg.offset[0], -0.6))
    angles, reachable = solve_leg(plain(leg), 0, far)
    assert not reachable
    assert np.isfinite(angles).all()
    q = np.tile(angles, 4)
    foot = foot_positions(leg, q)[0] - leg.hip[0]
    assert abs(np.linalg.norm(foot - (0.0, leg.offset[0], 0.0)) - 0.426) < 1e-3


def test_legs_of_other_shapes_are_inverted_too(model, rng):
    """Below its hip axis the thigh turns, front and rear differ, rear knees point forward."""
    leg = model.geometry._replace(
        drop=np.array((0.08, 0.08, 0.0, 0.0)),
        bend=np.array((1.0, 1.0, -1.0, -1.0)),
        thigh=np.array((0.2, 0.2, 0.25, 0.25)),
    )
    for _ in range(50):
        angles = some_angles(rng)
        angles[6:] *= np.tile((1.0, -1.0, -1.0), 2)
        motion = leg_motion(leg, angles, np.zeros(12))
        np.testing.assert_allclose(all_leg_angles(leg, motion.position), angles, atol=1e-7)
        shift = STEP * rng.normal(size=12)
        moved = foot_positions(leg, angles + shift) - foot_positions(leg, angles - shift)
        wanted = (motion.jacobian @ shift.reshape(4, 3, 1))[..., 0]
        np.testing.assert_allclose(0.5 * moved, wanted, atol=1e-10)
