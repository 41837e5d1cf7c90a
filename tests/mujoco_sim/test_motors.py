# SPDX-License-Identifier: Apache-2.0
"""Motors give what their torque-speed curve allows, in the simulation, too."""

from cases import for_all
from descriptions import robot_named
from mujoco_sim.compiled import TorqueSpeedCurve
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_core.robot_io import FULL_TORQUE_SHARE, JointCommand

TORQUE, SPEED = 23.7, 30.1


@pytest.fixture
def curve():
    return TorqueSpeedCurve(np.full(5, TORQUE), np.full(5, SPEED))


def at(speed):
    """Return the limits of one motor at a speed [rad/s]."""
    (limits,) = TorqueSpeedCurve(np.array([TORQUE]), np.array([SPEED])).limits(np.array([speed]))
    return tuple(limits)


def test_at_rest_a_motor_gives_its_full_torque_both_ways():
    assert at(0.0) == (-TORQUE, TORQUE)


@for_all('share', [0.1, 0.5, FULL_TORQUE_SHARE])
def test_up_to_the_knee_of_the_curve_it_gives_its_full_torque(share):
    assert at(share * SPEED) == pytest.approx((-TORQUE, TORQUE))


def test_from_there_it_falls_linearly_to_none_at_the_no_load_speed():
    middle = 0.5 * (FULL_TORQUE_SHARE + 1.0) * SPEED
    assert at(middle)[1] == pytest.approx(0.5 * TORQUE)
    assert at(SPEED)[1] == pytest.approx(0.0)
    assert at(2.0 * SPEED)[1] == 0.0


@for_all('speed', [10.0, 25.0, 40.0])
def test_braking_has_the_full_torque_at_any_speed(speed):
    assert at(speed)[0] == -TORQUE
    assert at(-speed)[1] == TORQUE


@for_all('speed', np.linspace(0.0, 50.0, 7))
def test_both_directions_are_alike(speed):
    lower, upper = at(speed)
    assert at(-speed) == (-upper, -lower)
    assert lower <= 0.0 <= upper


def test_each_motor_has_its_own_limits(curve):
    curve = TorqueSpeedCurve(np.array([20.0, 30.0]), np.array([10.0, 20.0]))
    np.testing.assert_allclose(curve.limits(np.array([10.0, 0.0])), [[-20, 0], [-30, 30]])


@pytest.fixture
def floating():
    """A Go2 far above the ground, with its motors' real limits."""
    loaded = robot_named('go2')
    speeds = {joint.name: joint.velocity for joint in loaded.robot.movable_joints}
    angles = {name: -1.5 for name in speeds if 'calf' in name}
    return build_world(
        loaded, setup=RobotSetup(joint_positions=angles, height=50.0, speed_limits=speeds)
    )


def push(effort, count=12):
    return JointCommand(
        np.zeros(count), np.zeros(count), np.full(count, effort), np.zeros(count), np.zeros(count)
    )


@pytest.mark.slow
def test_a_motor_never_gives_more_than_its_limit(floating):
    floating.apply(push(500.0))
    floating.step(1)
    # Hips and thighs 23.7 N m, knees 35.55.
    expected = [23.7, 23.7, 35.55] * 4
    np.testing.assert_allclose(floating.actuation.take_peak_effort(), expected)


@pytest.mark.slow
def test_a_motor_that_is_fast_drives_no_further(floating):
    joint = floating.joint_names.index('FL_thigh_joint')
    floating.data.qvel[6 + joint] = 35.0
    floating.apply(push(20.0))
    floating.step(1)
    assert floating.joints().effort[joint] == 0.0
    floating.apply(push(-20.0))
    floating.step(1)
    assert floating.joints().effort[joint] == pytest.approx(-20.0)


@pytest.mark.slow
def test_the_largest_effort_is_kept_until_it_is_taken(floating):
    floating.apply(push(5.0))
    floating.step(2)
    floating.apply(push(1.0))
    floating.step(2)
    np.testing.assert_allclose(floating.actuation.take_peak_effort(), 5.0)
    floating.step(1)
    np.testing.assert_allclose(floating.actuation.take_peak_effort(), 1.0)


@pytest.mark.slow
def test_a_command_takes_effect_after_the_delay():
    loaded = robot_named('go2')
    world = build_world(loaded, setup=RobotSetup(height=50.0, command_delay=0.002))
    world.apply(push(5.0))
    world.step(2)
    np.testing.assert_array_equal(world.data.ctrl, 0.0)
    world.step(1)
    np.testing.assert_array_equal(world.data.ctrl, 5.0)


@pytest.mark.slow
def test_braking_does_not_wait_for_a_command_on_its_way():
    world = build_world(robot_named('go2'), setup=RobotSetup(height=50.0, command_delay=0.002))
    world.apply(push(5.0))
    world.brake()
    world.step(5)
    np.testing.assert_array_equal(world.data.ctrl, 0.0)
