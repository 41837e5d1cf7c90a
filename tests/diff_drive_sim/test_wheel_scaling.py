# SPDX-License-Identifier: Apache-2.0
"""Motors are scaled to what a wheel moves: light, heavy and odd robots turn as they are told."""

from dataclasses import replace
import math
from pathlib import Path

from cases import for_all
from descriptions import robot_named
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.wheel_loop import wheel_motor
import numpy as np
import pytest
from robot_description.description import load_robot
from robot_description.morphology.equip_wheels import (
    axle_inertia,
    QUICKEST,
    size_motor,
    SLOWEST,
    Strength,
    strength,
    yaw_inertia,
)
from robot_description.morphology.wheels import find_drive
from robot_description.urdf import parse_urdf
import wasd
from wasd_core.robot_io import TIME_STEP
from wasd_core.rotations import matrix_from_quaternion, rpy_from_matrix

CATALOGUE = Path(__file__).parents[1] / 'catalogue' / 'wheels'
CARTS = (
    'vacuum_cleaner', 'top_heavy_yaw', 'turtle', 'carrier_50', 'carrier_150',
    'carrier_light_wheels', 'strong_motors', 'damped_joints',
)  # fmt: skip
TICK = 0.01


def yaws(cart: wasd.Mbot, seconds: float) -> list[float]:
    """Let it run; return its true heading [rad] every 10 ms."""
    found = []
    for _ in range(round(seconds / TICK)):
        cart.run(TICK)
        found.append(float(rpy_from_matrix(matrix_from_quaternion(cart.truth.orientation))[2]))
    return found


@pytest.mark.slow
@pytest.mark.parametrize('name', CARTS)
def test_a_turn_is_quick_does_not_overshoot_and_ends_where_it_should(name: str) -> None:
    cart = wasd.Mbot(description=str(CATALOGUE / f'{name}.xacro'))
    cart.run(1.0)
    before = yaws(cart, TICK)
    cart.drive(0.0, 1.0)
    turning = yaws(cart, 2.0 * math.pi)
    cart.drive(0.0)
    turned = np.unwrap(before + turning + yaws(cart, 1.0))
    rates = np.diff(turned)[: len(turning)] / TICK
    assert (rates[round(0.4 / TICK) :] >= 0.9).all()
    assert rates.max() <= 1.05
    expected = math.degrees(len(turning) * TICK)
    assert math.degrees(turned[-1] - turned[0]) == pytest.approx(expected, abs=2.0)


@pytest.mark.slow
def test_an_arm_that_a_cart_carries_is_held_while_it_turns():
    cart = wasd.Mbot(description=str(CATALOGUE / 'arm_on_wheels.xacro'))
    cart.drive(0.0, 2.0)
    cart.run(1.0)
    names = cart._world.joint_names
    arm = [names.index(f'{name}_joint') for name in ('lift', 'shoulder', 'elbow')]
    assert np.abs(cart._world.joints().position[arm]).max() < 0.005


def equipped(name):
    robot = load_robot(str(CATALOGUE / f'{name}.xacro')).robot
    return robot, find_drive(robot)


@pytest.mark.slow
@pytest.mark.parametrize('name', [*CARTS, 'weak_motors', 'cylinders'])
def test_a_loaded_wheel_nears_its_speed_as_soon_as_mbots_does_and_does_not_ring(name):
    robot, drive = equipped(name)
    size = size_motor(robot, drive)
    joint = drive.wheels[0].joint
    lag = max(size.straight, size.turning) / (size.damping - 4.0 * joint.damping)
    assert QUICKEST * (1.0 - 1e-9) <= lag <= SLOWEST * (1.0 + 1e-9) or joint.damping > 0.0
    # What the physics takes explicitly stops a wheel in the air in one step at the soonest.
    assert size.damping * TIME_STEP <= (axle_inertia(robot, joint) + size.rotor) * (1.0 + 1e-9)


def test_mbot_needs_no_rotor_and_keeps_the_motor_that_its_description_says(mbot):
    drive = find_drive(mbot)
    size = size_motor(mbot, drive)
    assert (size.damping, size.rotor) == (3.75 * 2.0 / 25.0, 0.0)
    assert size.straight == pytest.approx(0.5 * 1.8 * 0.06**2)


def test_the_yaw_inertia_is_that_of_all_links_about_the_axle(mbot):
    # A drum of 1 kg with a radius of 0.2 m, two wheels and two balls of 0.2 kg.
    parts = 0.5 * 1.0 * 0.2**2 + 2 * (0.2 * 0.19**2 + 0.2 * (3 * 0.06**2 + 0.025**2) / 12)
    balls = [link for name, link in mbot.links.items() if 'caster' in name]
    parts += sum(
        link.inertia[2, 2] + link.mass * float(mbot.zero_poses[link.name].position[0]) ** 2
        for link in balls
    )
    assert yaw_inertia(mbot, 0.0, 0.0) == pytest.approx(parts, rel=1e-3)
    assert yaw_inertia(mbot, 0.3, 0.4) == pytest.approx(parts + 1.8 * 0.25, rel=1e-3)


def test_torque_over_inertia_is_what_the_motors_allow(mbot):
    drive = find_drive(mbot)
    size = size_motor(mbot, drive)
    ahead, turning = strength(mbot, drive)
    own = axle_inertia(mbot, drive.wheels[0].joint)
    # Two wheels' torques move mass and wheels: 2 T = (M r + 2 I / r) a.
    assert pytest.approx((1.8 * 0.06 + 2.0 * own / 0.06) * ahead.speed_up) == 2.0 * 2.0
    yaw = yaw_inertia(mbot, 0.0, 0.0) + 0.5 * own * (0.38 / 0.06) ** 2
    assert pytest.approx(yaw * turning.speed_up) == 2.0 / 0.06 * 0.38
    assert size.turning < size.straight
    assert all(each.slow_down == each.speed_up for each in (ahead, turning))


def with_wheels(robot, **wheels):
    """Return a robot with other limits of its wheels' joints, by side."""
    joints = dict(robot.joints)
    for side, changes in wheels.items():
        joints[f'{side}_wheel_joint'] = replace(joints[f'{side}_wheel_joint'], **changes)
    return replace(robot, joints=joints)


def test_dry_friction_takes_of_what_speeds_up_and_adds_to_what_brakes(mbot):
    rubs = with_wheels(mbot, left={'friction': 0.5}, right={'friction': 0.5})
    for smooth, rough in zip(
        strength(mbot, find_drive(mbot)), strength(rubs, find_drive(rubs)), strict=True
    ):
        assert rough == pytest.approx((smooth.speed_up * 1.5 / 2.0, smooth.speed_up * 2.5 / 2.0))


@pytest.mark.parametrize('weak', ['left', 'right'])
@pytest.mark.parametrize('limits', [{'effort': 0.01}, {'friction': 1.99}], ids=['motor', 'joint'])
def test_the_weaker_of_two_wheels_decides_and_is_named(mbot, weak, limits):
    both = with_wheels(mbot, left=limits, right=limits)
    robot = with_wheels(mbot, **{weak: limits})
    found, weaker, usual = (strength(each, find_drive(each)) for each in (robot, both, mbot))
    for one, other, strong in zip(found, weaker, usual, strict=True):
        assert one.speed_up == pytest.approx(other.speed_up)
        # A joint that rubs brakes the better: there the stronger motor's wheel decides.
        assert one.slow_down == pytest.approx(min(other.slow_down, strong.slow_down))
    notes = DiffDrive(robot, DiffDriveParameters()).notes
    assert notes == tuple(
        note.replace('left', weak) for note in DiffDrive(both, DiffDriveParameters()).notes
    )
    assert notes[0].startswith(f'{weak}_wheel_joint has ')


@pytest.mark.slow
def test_a_weak_motor_is_told_with_its_torque_and_the_ramp_keeps_to_it():
    robot, _ = equipped('weak_motors')
    unit = DiffDrive(robot, DiffDriveParameters(cmd_vel_timeout=0.0))
    assert unit.notes == (
        'left_wheel_joint has 0.1 N m: enough for 0.3 m/s^2, not for the 1 of '
        'linear.x.max_acceleration',
        'left_wheel_joint has 0.1 N m: enough for 2.1 rad/s^2, not for the 6 of '
        'angular.z.max_acceleration',
    )
    unit.controller.command(1.0, 0.0)
    for _ in range(200):
        unit.step_fake(0.005)
    assert unit.controller.velocity.linear == pytest.approx(0.3, abs=0.02)
    assert DiffDrive(robot_named('mbot').robot, DiffDriveParameters()).notes == ()


@for_all(('timeout', 'is_told'), [(0.0, False), (0.03, True), (0.05, False), (0.5, False)])
def test_a_time_out_shorter_than_the_time_between_commands_is_told(mbot, timeout, is_told):
    notes = DiffDrive(mbot, DiffDriveParameters(cmd_vel_timeout=timeout)).notes
    line = (
        f'cmd_vel_timeout is {timeout:g} s, but scripts, the stick and goals command '
        'every 0.05 s: the robot brakes in between; usual is 0.5'
    )
    assert notes == (line,) * is_told


def test_a_motor_weaker_than_its_joints_friction_is_told(mbot):
    joints = {n: replace(j, friction=3.0) for n, j in mbot.joints.items()}
    unit = DiffDrive(replace(mbot, joints=joints), DiffDriveParameters())
    assert unit.notes == (
        'left_wheel_joint has 2 N m, its own friction takes 3: it does not move',
    )


def test_a_command_too_fast_for_a_wheel_is_told_once_with_joint_and_number(mbot):
    joints = {
        n: replace(j, velocity=5.0 if n == 'right_wheel_joint' else j.velocity)
        for n, j in mbot.joints.items()
    }
    unit = DiffDrive(replace(mbot, joints=joints), DiffDriveParameters())
    said = []
    unit.say = said.append
    for speed in (0.2, 0.3, 1.0, 0.5, 1.0):
        unit.controller.command(speed, 0.0)
        unit.step_fake(0.005)
        assert len(said) == (speed > 0.3 or bool(said))
    assert said == [
        'right_wheel_joint turns at 5 rad/s at most: 0.3 m/s and 0 rad/s in place of 1 m/s and '
        '0 rad/s'
    ]


def test_a_joint_that_damps_is_driven_against_its_drag(mbot):
    joints = {n: replace(j, damping=0.01, friction=0.5) for n, j in mbot.joints.items()}
    motor = wheel_motor(replace(mbot, joints=joints), find_drive(replace(mbot, joints=joints)))
    for speed in (3.0, -3.0):
        torque = motor.damping * (motor.duty(speed) * motor.speed - speed)
        assert torque == pytest.approx(0.01 * speed + math.copysign(0.5, speed))
    assert motor.duty(0.0) == 0.0
    assert motor.top_speed == pytest.approx(25.0 * motor.damping / (motor.damping + 0.01))


def test_a_robot_without_masses_has_no_motors_to_size():
    text = (CATALOGUE / 'no_masses.urdf').read_text()
    robot = parse_urdf(text)
    assert size_motor(robot, find_drive(robot)).damping == 0.0
    assert strength(robot, find_drive(robot)) == (Strength(), Strength())
    assert Strength() == (math.inf, math.inf)
