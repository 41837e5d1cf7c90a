# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from leg_stages import dynamics_of
import numpy as np
import pytest
from quadruped_sim.dynamics import drag
from quadruped_sim.estimation.touch import ContactDetector, feel_touch, find_touch
from quadruped_sim.leg_kinematics import leg_motion
from quadruped_sim.robot_state import RobotState

pytestmark = pytest.mark.slow

DT = 0.002
LEVEL = np.array((1.0, 0.0, 0.0, 0.0))
UP = np.array((0.0, 0.0, 1.0))
ANGLES = np.tile((0.0, 0.8, -1.6), 4)


def hold(model, rules, detector, forces, seconds=0.2):
    """Statics: the torques that hold the legs still under `forces` (4, 3) on the feet."""
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    dynamics = dynamics_of(model, LEVEL, np.zeros(3), np.zeros(3), ANGLES, np.zeros(12))
    torque = dynamics.bias[6:] - np.einsum('lji,lj->li', motion.jacobian, forces).ravel()
    robot = replace(RobotState.blank(), motion=motion, dynamics=dynamics)
    for _ in range(round(seconds / DT)):
        feel_touch(detector.flat, robot.flat, torque, rules, DT)
        find_touch(detector.flat, UP, rules)


def test_static_forces_are_recovered(model, rules):
    detector = ContactDetector()
    forces = np.array(((5.0, 1.0, 60.0), (0.0, 0.0, 0.0), (-3.0, 2.0, 30.0), (0.0, 0.0, 90.0)))
    hold(model, rules, detector, forces)
    np.testing.assert_allclose(detector.forces, forces, atol=0.3)
    np.testing.assert_array_equal(detector.is_contact, (True, False, True, True))


def test_what_joints_lose_as_they_turn_is_no_force_on_a_foot(model, rules):
    """A leg in the air turns evenly: its motors give what it weighs and what its joints lose."""
    detector, rates = ContactDetector(), np.tile((2.0, -8.0, 16.0), 4)
    robot = RobotState.blank()
    for tick in range(50):
        angles = ANGLES + rates * DT * (tick - 25)
        dynamics = dynamics_of(model, LEVEL, np.zeros(3), np.zeros(3), angles, rates)
        losses = [drag(model.rigid[0][0], joint, rate) for joint, rate in enumerate(rates)]
        motion = leg_motion(model.geometry, angles, rates)
        robot = replace(robot, motion=motion, dynamics=dynamics)
        torque = dynamics.bias[6:] + losses
        feel_touch(detector.flat, robot.flat, torque, rules, DT)
    # Of 1.8 N m in the knee, nothing: what is left is the observer's own lag.
    assert np.abs(detector.forces).max() < 1.0


def test_hysteresis_keeps_a_light_contact_and_ignores_a_light_touch(model, rules):
    detector = ContactDetector()
    light = np.zeros((4, 3))
    light[:, 2] = 18.0
    hold(model, rules, detector, light)
    assert not detector.is_contact.any()
    hold(model, rules, detector, 3.0 * light)
    assert detector.is_contact.all()
    hold(model, rules, detector, light)
    assert detector.is_contact.all()
    hold(model, rules, detector, 0.0 * light)
    assert not detector.is_contact.any()
