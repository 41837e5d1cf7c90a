# SPDX-License-Identifier: Apache-2.0
"""The command law, and its way through a message."""

from pathlib import Path

from builtin_interfaces.msg import Time
from cases import for_all
from descriptions import robot_named
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wasd_core.errors import InvalidMessage
from wasd_core.messages import from_joint_commands, to_joint_commands
from wasd_core.robot_io import JointCommand

LIMIT = 2.0
CATALOGUE = Path(__file__).parents[1] / 'catalogue'
NAMES = ('left_wheel_joint', 'right_wheel_joint')
COMMAND = JointCommand(
    position=np.array([0.3, -0.2]),
    velocity=np.array([4.0, -1.0]),
    effort=np.array([0.1, -0.3]),
    kp=np.array([0.5, 2.0]),
    kd=np.array([0.2, 0.1]),
)


def law(command, world):
    """Return what the motors should apply now, by hand."""
    joints = world.joints()
    effort = (
        command.effort
        + command.kp * (command.position - joints.position[:2])
        + command.kd * (command.velocity - joints.velocity[:2])
    )
    return np.clip(effort, -LIMIT, LIMIT)


@pytest.mark.slow
def test_the_law_holds_at_every_physics_step(world):
    assert world.apply(COMMAND)
    for _ in range(200):
        wanted = law(COMMAND, world)
        world.step()
        np.testing.assert_allclose(world.joints().effort[:2], wanted, atol=1e-12)
    assert np.abs(world.joints().velocity[:2]).min() > 0.1  # it did move


def test_a_command_is_followed_between_commands_too(loaded):
    # Were the torque held until the next command, commanding ten times less often would show.
    worlds = [build_world(loaded) for _ in range(2)]
    worlds[0].apply(COMMAND)
    worlds[0].step(200)
    for _ in range(200):
        worlds[1].apply(COMMAND)
        worlds[1].step()
    np.testing.assert_array_equal(worlds[0].data.qpos, worlds[1].data.qpos)


def test_sensors_measure_on_after_a_step_that_was_interrupted(world, monkeypatch):
    """As by Ctrl-C in a notebook, whose owner goes on."""

    def interrupt():
        raise KeyboardInterrupt

    flags = world.model.opt.disableflags
    with monkeypatch.context() as patched:
        patched.setattr(world.actuation, 'begin_steps', lambda: interrupt)
        with pytest.raises(KeyboardInterrupt):
            world.physics.step(5)
    assert world.model.opt.disableflags == flags


@pytest.mark.parametrize('effort', [50.0, -50.0])
def test_no_motor_gives_more_than_its_limit(world, effort):
    world.apply(COMMAND._replace(effort=np.full(2, effort)))
    world.step()
    np.testing.assert_array_equal(world.joints().effort[:2], np.sign(effort) * np.full(2, LIMIT))


@pytest.mark.parametrize('robot', ['mbot', 'go2'])  # without and with a torque-speed curve
@pytest.mark.parametrize('part', ['position', 'velocity', 'effort'])
@pytest.mark.parametrize('value', [1e11, -1e300])
def test_what_one_motor_cannot_give_changes_no_other(robot, part, value):
    loaded = robot_named(robot)

    def efforts(told):
        world = build_world(loaded, setup=usual_setup(loaded, noise=False))
        parts = dict(
            zip(JointCommand._fields, np.full((5, len(world.motor_names)), 0.1), strict=True)
        )
        parts[part][0] = told
        assert world.apply(JointCommand(**parts))
        world.step(5)  # commands are delayed
        return world.joints().effort

    np.testing.assert_array_equal(efforts(value), efforts(np.copysign(1e6, value)))


@pytest.mark.parametrize('part', JointCommand._fields)
@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_refused_and_the_motors_brake(world, part, value):
    world.apply(COMMAND)
    world.step(100)
    assert not world.apply(COMMAND._replace(**{part: np.array([0.1, value])}))
    assert world.actuation.rejected_commands == 1
    velocity = world.joints().velocity[:2]
    world.step()
    np.testing.assert_allclose(world.joints().effort[:2], -COMMAND.kd * velocity, atol=1e-12)
    assert np.isfinite(world.data.qpos).all()


def test_a_part_of_a_command_that_is_written_into_counts_though_others_cannot_be(world):
    command = COMMAND._replace(
        position=np.broadcast_to(0.0, 2), kp=np.zeros(2), kd=np.zeros(2), effort=np.zeros(2)
    )
    world.apply(command)
    command.effort[:] = 0.1
    world.apply(command)
    world.step()
    np.testing.assert_allclose(world.joints().effort[:2], 0.1)


@pytest.mark.parametrize('length', [0, 1, 3])
def test_a_command_of_the_wrong_length_is_refused(world, length):
    assert not world.apply(JointCommand(*[np.zeros(length)] * 5))
    assert world.actuation.rejected_commands == 1


def test_braking_takes_energy_out(world):
    world.apply(COMMAND._replace(kp=np.zeros(2)))
    world.step(500)
    before = np.abs(world.joints().velocity[:2])
    world.brake()
    world.step(500)
    assert (np.abs(world.joints().velocity[:2]) < 0.2 * before).all()


def test_a_new_world_lets_its_wheels_go(world):
    world.step()
    np.testing.assert_array_equal(world.joints().effort, np.zeros(4))


def test_a_command_survives_its_message():
    message = to_joint_commands(NAMES, COMMAND, Time(sec=1))
    assert message.header.stamp == Time(sec=1)
    for sent, received in zip(COMMAND, from_joint_commands(message, NAMES), strict=True):
        np.testing.assert_array_equal(sent, received)


def test_joints_are_matched_by_name():
    message = to_joint_commands(NAMES[::-1], COMMAND, Time())
    for sent, received in zip(COMMAND, from_joint_commands(message, NAMES), strict=True):
        np.testing.assert_array_equal(sent[::-1], received)


def test_what_a_message_leaves_out_is_zero():
    message = JointTrajectory(joint_names=[NAMES[1]])
    message.points = [JointTrajectoryPoint(effort=[0.7]), JointTrajectoryPoint(velocities=[0.1])]
    command = from_joint_commands(message, NAMES)
    np.testing.assert_array_equal(command.effort, [0.0, 0.7])
    np.testing.assert_array_equal(command.kd, [0.0, 0.1])
    for part in (command.position, command.velocity, command.kp):
        np.testing.assert_array_equal(part, [0.0, 0.0])


def test_unknown_joints_are_named_with_the_known_ones():
    message = to_joint_commands(('base_l_wheel_joint', NAMES[1]), COMMAND, Time())
    with pytest.raises(
        InvalidMessage, match='names base_l_wheel_joint; motors are left_wheel_joint, right'
    ):
        from_joint_commands(message, NAMES)


@for_all('count', [0, 1, 3])
def test_missing_gains_are_named(count):
    message = JointTrajectory(joint_names=list(NAMES), points=[JointTrajectoryPoint()] * count)
    with pytest.raises(InvalidMessage, match=rf'2 points \(set-point, gains\), got {count}'):
        from_joint_commands(message, NAMES)


def test_a_list_that_is_too_short_is_named():
    message = to_joint_commands(NAMES, COMMAND, Time())
    message.points[1].velocities = [0.1]
    with pytest.raises(InvalidMessage, match='2 joints but a list of 1 values'):
        from_joint_commands(message, NAMES)


@pytest.mark.slow
def test_joints_of_a_robot_that_nobody_drives_follow_commands():
    arm = load_robot(str(CATALOGUE / 'legs/arm_alone.xacro'))
    world = build_world(arm)
    count = len(world.motor_names)
    angles, still = np.full(count, 0.2), np.zeros(count)
    world.apply(JointCommand(angles, still, still, np.full(count, 100.0), np.full(count, 2.0)))
    world.step(1500)
    assert count == 5
    np.testing.assert_allclose(world.joints().position, angles, atol=0.05)
