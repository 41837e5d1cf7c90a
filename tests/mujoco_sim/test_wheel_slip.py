# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
from mujoco_sim.scene import ROOM_SIZE
from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.sensors.wheel_slip import slip, WheelSlip
from mujoco_sim.world import build_world, World
import numpy as np
import pytest
from robot_description.mujoco.builder import to_mujoco
from robot_description.urdf import parse_urdf
import wasd
from wasd_core.robot_io import JointCommand

RADIUS, HALF_TRACK = 0.06, 0.19


@for_all(
    ('rolling', 'moving', 'ratio'),
    [
        (0.5, 0.5, 0.0),
        (-0.5, -0.5, 0.0),
        (0.5, 0.0, 1.0),  # spins in place
        (-0.5, 0.0, 1.0),
        (0.0, 0.5, -1.0),  # slides, locked
        (0.0, -0.5, -1.0),
        (0.5, 0.4, 0.2),  # drives: a fifth of the turning is lost
        (0.4, 0.5, -0.2),  # brakes
        (0.5, -0.5, 2.0),
        (0.0005, 0.0, 0.0),
    ],
)
def test_the_ratio_is_the_difference_over_the_faster_of_the_two(rolling, moving, ratio):
    assert slip(rolling, moving).ratio == pytest.approx(ratio)
    assert slip(rolling, moving).speed == rolling - moving


@pytest.fixture
def measured(world, loaded):
    """Return a function that measures mbot's slip at a speed, a yaw rate and wheel speeds."""
    wheels = WheelSlip(world, loaded.robot, Snapshot(world))
    assert wheels.joints == ('left_wheel_joint', 'right_wheel_joint')

    def measure(linear, angular, left, right, sideways=0.0):
        yaw = 0.7
        cos, sin = math.cos(yaw), math.sin(yaw)
        world.data.qpos[3:7] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
        world.data.qvel[:2] = linear * cos - sideways * sin, linear * sin + sideways * cos
        world.data.qvel[5] = angular
        for name, speed in (('left', left), ('right', right)):
            world.data.joint(f'{name}_wheel_joint').qvel[0] = speed
        return wheels.measure()

    return measure


def test_wheels_that_roll_along_an_arc_do_not_slip(measured):
    linear, angular = 0.4, 1.3
    left = (linear - HALF_TRACK * angular) / RADIUS
    right = (linear + HALF_TRACK * angular) / RADIUS
    for wheel in measured(linear, angular, left, right):
        assert wheel.ratio == pytest.approx(0.0, abs=1e-12)
        assert wheel.speed == pytest.approx(0.0, abs=1e-12)


def test_a_wheel_that_spins_in_place_slips_by_all_it_turns(measured):
    left, right = measured(0.0, 0.0, 5.0, -5.0)
    assert (left.ratio, right.ratio) == (pytest.approx(1.0), pytest.approx(1.0))
    assert (left.speed, right.speed) == (pytest.approx(0.3), pytest.approx(-0.3))


def test_a_robot_that_slides_with_its_wheels_locked_slips_by_all_it_moves(measured):
    for wheel in measured(0.5, 0.0, 0.0, 0.0):
        assert wheel.ratio == pytest.approx(-1.0)
        assert wheel.speed == pytest.approx(-0.5)


def test_at_rest_nothing_slips(measured):
    assert [wheel.ratio for wheel in measured(0.0, 0.0, 0.0, 0.0)] == [0.0, 0.0]


def test_a_robot_pushed_sideways_does_not_slip_along_its_wheels(measured):
    for wheel in measured(0.0, 0.0, 0.0, 0.0, sideways=0.5):
        assert wheel.speed == pytest.approx(0.0, abs=1e-12)


CYLINDER = '<collision>{}<geometry><cylinder radius="0.05" length="0.1"/></geometry></collision>'
INERTIA = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def with_links(loaded, *links):
    """Return mbot with joints on its base, each of a name, a kind, an axis and a shape."""
    text, parent = '', loaded.robot.base
    for name, kind, axis, shape in links:
        text += f'<link name="{name}">{INERTIA}{shape}</link><joint name="{name}_joint" type="'
        text += f'{kind}"><origin xyz="0 0 0.5"/><parent link="{parent}"/><child link="{name}"/>'
        text += (
            f'<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="1" velocity="9"/></joint>'
        )
        parent = name
    robot = parse_urdf(loaded.urdf.replace('</robot>', f'{text}</robot>'))
    world = World(to_mujoco(robot), robot.base)
    return world, WheelSlip(world, robot, Snapshot(world))


def test_a_turret_is_no_wheel(loaded):
    turret = ('turret', 'continuous', '0 0 1', CYLINDER.format(''))
    wheels = with_links(loaded, turret)[1]
    assert wheels.joints == ('left_wheel_joint', 'right_wheel_joint')
    assert len(wheels.measure()) == 2


def test_a_wheel_that_is_laid_flat_does_not_slip(loaded):
    lying = CYLINDER.format('<origin rpy="1.5707963267948966 0 0"/>')
    world, wheels = with_links(
        loaded, ('arm', 'revolute', '1 0 0', ''), ('third', 'continuous', '0 1 0', lying)
    )
    assert wheels.joints[2] == 'third_joint'
    world.data.joint('arm_joint').qpos[0] = math.pi / 2.0
    world.data.joint('third_joint').qvel[0] = 9.0
    assert wheels.measure()[2] == (0.0, 0.0)


@pytest.mark.slow
def test_wheels_that_push_against_a_wall_spin_in_place(loaded):
    room = build_world(loaded, 'room')
    wheels = WheelSlip(room, loaded.robot, Snapshot(room))
    room.data.qpos[0] = ROOM_SIZE / 2.0 - 0.21
    zeros = np.zeros(2)
    room.apply(JointCommand(zeros, np.full(2, 20.0), zeros, zeros, np.full(2, 0.3)))
    room.step(500)
    ratios = []
    for _ in range(100):
        room.step(20)
        ratios.append([wheel.ratio for wheel in wheels.measure()])
    # The drum bounces off the wall a little, so each by itself is around 1.
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.05)
    assert np.min(ratios) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ('degrees', 'speed', 'passes'), [(2.0, 0.3, False), (3.0, 0.5, True), (5.0, 0.5, False)]
)
def test_an_upward_kink_holds_mbot_up_unless_it_is_fast(degrees, speed, passes):
    mbot = wasd.Mbot(world=f'slope:{degrees}')
    mbot.drive(speed, 0.0)
    mbot.run(2.0 / speed)
    # Beyond the kink the wheels go on to roll it ahead, or spin in the air.
    assert (mbot.truth.position[0] > 0.8 * mbot.odometry.position[0]) == passes
