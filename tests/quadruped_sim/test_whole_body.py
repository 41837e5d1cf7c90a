# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from leg_stages import dynamics_of
from mujoco_sim.compiled import TorqueSpeedCurve
import numpy as np
import pytest
from quadruped_sim.leg_kinematics import leg_motion
from quadruped_sim.locomotion.whole_body import motor_range, WholeBody, WholeBodyTask
from quadruped_sim.robot_state import BaseMotion, RobotState
from quadruped_sim.tuning import MpcParameters, WholeBodyParameters
from wasd_core.rotations import matrix_from_quaternion, rpy_matrix, to_quaternion


@pytest.fixture
def solve(model, angles, contact_points):
    """Return a function that solves for a random state and returns all that the checks need."""
    strong = replace(model.limits, effort=np.full(12, 1e6))

    def solve(rng, stance, force_weight=1e-9, limits=strong):
        orientation = np.array(to_quaternion(rpy_matrix(0.1, -0.05, 0.7)))
        R = matrix_from_quaternion(orientation)
        rates = 0.5 * rng.normal(size=12)
        velocity, omega = rng.normal(size=3), 0.5 * rng.normal(size=3)
        motion = leg_motion(model.geometry, angles, rates)
        contact = contact_points(motion, R.T @ (0.0, 0.0, 1.0), model.geometry.foot_radius)
        dynamics = dynamics_of(model, orientation, velocity, omega, angles, rates)
        forces = np.zeros((4, 3))
        forces[stance, 2] = model.weight / stance.sum()
        task = WholeBodyTask(
            np.array((0.2, -0.1, 0.3, 0.4, 0.2, -0.1)),
            stance,
            forces,
            5.0 * rng.normal(size=(4, 3)),
            np.eye(3),
        )
        weights = WholeBodyParameters(force_weight=force_weight)
        body = WholeBody(weights, MpcParameters(friction=5.0), limits)
        base = BaseMotion(np.zeros(3), R @ velocity, R, np.array((0.1, -0.05, 0.7)), omega)
        result = body.solve(
            task,
            RobotState(
                joint_position=angles,
                joint_velocity=rates,
                orientation=orientation,
                base=base,
                motion=motion,
                contact=contact,
                dynamics=dynamics,
                feet=motion.position @ R.T,
                normal_forces=forces[:, 2],
                is_contact=stance,
                forces=forces @ R,
            ),
        )
        return task, result, R, velocity, omega, motion, contact, dynamics

    return solve


@pytest.mark.parametrize('stance', [(True,) * 4, (True, True, True, False)])
def test_torques_bring_about_the_wanted_accelerations(solve, rng, stance):
    """Forward dynamics with the answer's torques and forces gives back base and foot tasks."""
    stance = np.array(stance)
    task, result, R, velocity, omega, motion, contact, dynamics = solve(rng, stance)
    assert result.is_solved
    generalized = np.concatenate((np.zeros(6), result.torque)) - dynamics.bias
    for leg in range(4):
        force = R.T @ result.forces[leg]
        generalized[:3] += force
        generalized[3:6] += np.cross(contact.position[leg], force)
        generalized[6 + 3 * leg : 9 + 3 * leg] += contact.jacobian[leg].T @ force
    acceleration = np.linalg.solve(dynamics.mass, generalized)
    linear = R @ (acceleration[:3] + np.cross(omega, velocity))
    np.testing.assert_allclose(linear, task.base_acceleration[:3], atol=1e-3)
    np.testing.assert_allclose(R @ acceleration[3:6], task.base_acceleration[3:], atol=1e-3)
    for leg in np.flatnonzero(~stance):
        p = motion.position[leg]
        foot = acceleration[:3] + np.cross(omega, velocity) + np.cross(acceleration[3:6], p)
        foot += np.cross(omega, np.cross(omega, p) + 2.0 * motion.velocity[leg]) + motion.bias[leg]
        foot += motion.jacobian[leg] @ acceleration[6 + 3 * leg : 9 + 3 * leg]
        np.testing.assert_allclose(R @ foot, task.foot_acceleration[leg], atol=1e-6)


def test_swing_legs_carry_nothing(solve, rng):
    stance = np.array((True, False, False, True))
    _, result, *_ = solve(rng, stance)
    np.testing.assert_array_equal(result.forces[~stance], 0.0)


def test_a_heavy_force_weight_returns_the_wanted_forces(solve, rng):
    task, result, *_ = solve(rng, np.ones(4, dtype=bool), force_weight=1e6)
    np.testing.assert_allclose(result.forces, task.forces, atol=1e-2)


def test_torques_that_the_motors_have_not_are_not_asked_for(model, solve):
    stance = np.ones(4, dtype=bool)
    free, weak = (
        solve(np.random.default_rng(7), stance, 1e-3, replace(model.limits, effort=effort))[1]
        for effort in (np.full(12, 1e6), np.full(12, 5.0))
    )
    assert np.abs(free.torque).max() > 6.0
    assert np.abs(weak.torque).max() == pytest.approx(5.0, abs=0.05)
    assert weak.is_solved


def test_where_motors_cannot_hold_at_all_the_qp_is_solved_still(model, solve, rng):
    weak = replace(model.limits, effort=np.full(12, 0.1))
    _, result, *_ = solve(rng, np.ones(4, dtype=bool), 1e-3, weak)
    assert result.is_solved
    assert (result.forces[:, 2] >= MpcParameters().force_min - 1e-6).all()


def test_the_motors_that_it_reckons_with_are_the_simulated_ones(model):
    effort, no_load = model.limits.effort, model.limits.velocity
    curve = TorqueSpeedCurve(effort, no_load)
    for share in np.linspace(-1.5, 1.5, 31):
        velocity = share * no_load
        simulated = curve.limits(velocity).T
        np.testing.assert_allclose(motor_range(effort, no_load, velocity), simulated, atol=1e-9)


def test_a_motor_gives_all_at_rest_and_when_it_brakes_and_nothing_at_its_no_load_speed(model):
    effort, no_load = model.limits.effort, model.limits.velocity
    for speed, share in ((0.0, 1.0), (0.6, 1.0), (0.8, 0.5), (1.0, 0.0), (2.0, 0.0)):
        least, most = motor_range(effort, no_load, speed * no_load)
        np.testing.assert_allclose(most, share * effort, atol=1e-9)
        np.testing.assert_array_equal(least, -effort)
        np.testing.assert_array_equal(motor_range(effort, no_load, -speed * no_load)[0], -most)
