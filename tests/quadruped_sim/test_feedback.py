# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.dynamics import drag
from quadruped_sim.locomotion.feedback import joint_command
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import blank_targets
from quadruped_sim.tuning import WholeBodyParameters


@pytest.mark.slow
def test_motors_are_told_what_joints_lose_as_they_turn_as_wanted(model, robot_state):
    """Both legs that stand, below a base that moves, and legs that are led through the air."""
    base = robot_state.base.position
    ahead = BaseReference(base, np.zeros(3), np.array((0.5, 0.1, 0.0)), 0.3)
    swing = blank_targets(np.array((True, False, False, True)))
    swing.position[:] = robot_state.feet + (0.0, 0.0, 0.02)
    swing.velocity[:], swing.acceleration[:] = (1.5, 0.0, 0.4), 0.0
    effort = np.linspace(-10.0, 10.0, 12)
    command = joint_command(WholeBodyParameters(), model, robot_state, ahead, swing, effort)
    wanted = [drag(model.rigid[0][0], joint, rate) for joint, rate in enumerate(command.velocity)]
    np.testing.assert_allclose(command.effort - effort, wanted, atol=1e-12)
    assert np.abs(command.velocity).reshape(4, 3).max(axis=1).min() > 0.5
    joint = model.quadruped.joints[0]
    turning = np.abs(command.velocity) > 1.5  # here all of the dry friction is told
    losses = joint.damping * command.velocity + joint.friction * np.sign(command.velocity)
    np.testing.assert_allclose((command.effort - effort)[turning], losses[turning], atol=2e-3)
    assert turning.sum() >= 6
