# SPDX-License-Identifier: Apache-2.0
"""The motor that a description makes, and the loop on it in the simulation's physics."""

from dataclasses import replace
import math

from descriptions import robot_named
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import DiffDriveParameters
from diff_drive_sim.wheel_loop import wheel_motor
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.morphology.equip_wheels import rotors, size_motor, STALL_SHARE
from robot_description.morphology.wheels import find_drive
from wasd_core.robot_io import JointCommand, TIME_STEP

DT = 0.005


def test_stall_torque_and_no_load_speed_are_the_ends_of_its_line(mbot):
    motor = wheel_motor(mbot, find_drive(mbot))
    assert motor.speed == 25.0
    assert motor.damping * motor.speed == pytest.approx(STALL_SHARE * 2.0)
    # Half the robot on a wheel: m r^2 / 2 over the damping.
    assert motor.lag == pytest.approx(0.5 * 1.8 * 0.06**2 / motor.damping)


def test_a_light_wheel_gets_a_rotor_so_that_the_physics_step_allows_its_line(mbot):
    links = {
        name: replace(link, mass=0.01, inertia=link.inertia / 20.0) if 'wheel' in name else link
        for name, link in mbot.links.items()
    }
    light = replace(mbot, links=links)
    size = size_motor(light, find_drive(light))
    own = 0.5 * 0.01 * 0.06**2
    assert size.damping == pytest.approx(STALL_SHARE * 2.0 / 25.0, rel=0.2)
    assert size.rotor + own == pytest.approx(size.damping * TIME_STEP)
    assert rotors(light, find_drive(light)) == dict.fromkeys(
        ('left_wheel_joint', 'right_wheel_joint'), size.rotor
    )
    assert rotors(mbot, find_drive(mbot)) == {}


def test_without_limits_it_has_no_torque(mbot):
    joints = {name: replace(joint, effort=0.0) for name, joint in mbot.joints.items()}
    bare = replace(mbot, joints=joints)
    motor = wheel_motor(bare, find_drive(bare))
    assert (motor.damping, motor.lag) == (0.0, math.inf)


class Rig:
    """mbot in its world, with other limits of its wheels' joints, stepped by a DiffDrive."""

    def __init__(self, wheels=None, **parameters):
        loaded = robot_named('mbot')
        joints = {
            name: replace(joint, **(wheels or {})) if 'wheel' in name else joint
            for name, joint in loaded.robot.joints.items()
        }
        loaded = replace(loaded, robot=replace(loaded.robot, joints=joints))
        self.world = build_world(loaded)
        self.unit = DiffDrive(loaded.robot, DiffDriveParameters(**parameters))
        names = ('left_wheel_joint', 'right_wheel_joint')
        self._joints = [self.world.joint_names.index(name) for name in names]
        self._motors = [self.world.motor_names.index(name) for name in names]

    def run(self, linear, duration):
        """Return speeds [m/s] and largest torques [N m] of each step."""
        command = np.zeros((5, len(self.world.motor_names)))
        command[4, self._motors] = self.unit.motor.damping
        rows = []
        for _ in range(round(duration / DT)):
            self.unit.controller.command(linear, 0.0)
            angles = self.world.joints().position[self._joints].tolist()
            command[1, self._motors] = self.unit.step(*angles, DT)
            self.world.apply(JointCommand(*command))
            self.world.step(round(DT / self.world.time_step))
            torque = np.abs(self.world.joints().effort).max()
            rows.append((self.world.base().planar_velocity[0], torque))
        return np.array(rows).T


@pytest.mark.slow
@pytest.mark.parametrize('acceleration', [math.nan, 3.0])
@pytest.mark.parametrize('gains', [(5.0, 1.0, 50.0), (12.0, 12.0, 50.0), (25.0, 30.0, 100.0)])
def test_a_step_of_the_robot_overshoots_by_less_than_5_percent_and_ends_at_rest(
    gains, acceleration
):
    Kp, Kd, Ko = gains
    rig = Rig(Kp=Kp, Kd=Kd, Ko=Ko, linear_max_acceleration=acceleration)
    speeds, _ = rig.run(0.3, 1.5)
    assert speeds.max() <= 1.05 * 0.3
    assert speeds[round(0.15 / DT)] >= 0.95 * 0.3
    speeds, _ = rig.run(0.0, 1.0)
    assert speeds.min() >= -0.05 * 0.3
    assert np.abs(speeds[-20:]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize('speed', [0.05, 0.1, 0.2, 0.35, 0.5])
def test_the_robot_settles_at_the_speed_that_is_wanted(speed):
    rig = Rig()
    rig.run(speed, 1.5)
    speeds, _ = rig.run(speed, 1.0)
    assert speeds.mean() == pytest.approx(speed, rel=0.005)


@pytest.mark.slow
def test_no_command_asks_more_than_its_torque_of_a_motor():
    rig = Rig(linear_max_acceleration=math.nan)
    _, first = rig.run(1.0, 0.2)
    _, reverse = rig.run(-1.0, 0.2)
    assert max(first.max(), reverse.max()) == pytest.approx(2.0)


@pytest.mark.slow
def test_dry_friction_makes_no_stop_longer():
    stops = []
    for friction in (0.0, 0.97):
        rig = Rig({'effort': 1.0, 'friction': friction})
        speeds, _ = rig.run(0.3, 2.0)
        assert speeds[-1] == pytest.approx(0.3, rel=0.02)
        speeds, _ = rig.run(0.0, 1.0)
        stops.append(next(index * DT for index, speed in enumerate(speeds) if speed < 0.003))
    assert stops[1] <= stops[0] < 0.4
