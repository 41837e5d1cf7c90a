# SPDX-License-Identifier: Apache-2.0
"""`--guard` in a run: for each source the robot stops before what its lidar sees."""

import math

from diff_drive_sim.odometry import PlanarCovariance
import numpy as np
import pytest
from wasd_bringup.run.navigation import _settings
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_bringup.run.sensing import NOISE
from wasd_core.errors import UserError
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.planning.motion import HARD

pytestmark = pytest.mark.slow

# A wall 1.5 m ahead, and none elsewhere.
WALL = """<mujoco><worldbody>
<geom name="floor" type="plane" size="0 0 0.05" friction="1 0.02 0.001"/>
<geom name="wall" type="box" pos="1.55 0 0.4" size="0.05 3 0.4"/>
</worldbody></mujoco>"""
# How far its front is from its base, and what is kept [m].
FRONT, KEPT = {'mbot': 0.212, 'go2': 0.34}, 0.01


# 41 kg on two wheels whose motors brake by 0.19 m/s^2.
ROUND_WHEEL = """<link name="{side}"><inertial><mass value="0.5"/>
<inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.1" length="0.04"/></geometry>
</collision></link><joint name="{side}_joint" type="continuous"><parent link="base"/>
<child link="{side}"/><origin xyz="0 {y} 0.1"/><axis xyz="0 1 0"/>
<limit effort="0.5" velocity="10"/></joint>"""
HEAVY = f"""<robot name="heavy"><link name="base"><inertial><mass value="40"/>
<inertia ixx="0.5" iyy="0.5" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.15"/><geometry><box size="0.4 0.2 0.1"/></geometry></collision>
<collision><origin xyz="0.17 0 0.02"/><geometry><sphere radius="0.02"/></geometry></collision>
<collision><origin xyz="-0.17 0 0.02"/><geometry><sphere radius="0.02"/></geometry></collision>
</link>{ROUND_WHEEL.format(side='left', y=0.15)}{ROUND_WHEEL.format(side='right', y=-0.15)}
<link name="laser"/><joint name="laser_joint" type="fixed"><parent link="base"/>
<child link="laser"/><origin xyz="0 0 0.3"/></joint>
<gazebo reference="laser"><sensor type="ray" name="lidar"><update_rate>10</update_rate><ray><scan>
<horizontal><samples>360</samples><min_angle>-3.14</min_angle><max_angle>3.14</max_angle>
</horizontal></scan><range><min>0.1</min><max>10</max></range></ray></sensor></gazebo></robot>"""


class Guarded:
    """A robot before a wall."""

    def __init__(self, robot, folder, guard=True, description=None):
        world = folder / 'wall.xml'
        world.write_text(WALL)
        preset = 'mbot' if robot == 'mbot' else 'unitree'
        options = RunOptions(
            robot=robot,
            description=description or robot,
            preset=preset,
            world=str(world),
            speed=0.0,
            guard=guard,
        )
        self.run = Run(options)
        self.name, self.robot = robot, self.run.robot

    def go_on(self, seconds):
        self.run.simulation.advance(round(seconds / self.run.world.time_step))

    def repeat(self, act, seconds):
        for _ in range(round(seconds / 0.05)):
            act()
            self.go_on(0.05)

    def approach(self, act, seconds):
        """
        Repeat for `seconds`, or until half a second after it first stands before the wall.

        Return how near to the wall its front came [m]: it may bounce off.
        """
        nearest, left = self.room, round(seconds / 0.05)
        while left > 0:
            self.repeat(act, 0.05)
            nearest, left = min(nearest, self.room), left - 1
            if self.room < 0.4 and np.hypot(*self.run.world.base().linear_velocity[:2]) < 0.01:
                left = min(left, 10)
        return nearest

    @property
    def room(self):
        """How far its front is from the wall [m]."""
        return 1.5 - FRONT[self.name] - float(self.run.world.base().position[0])


@pytest.fixture
def begin(tmp_path):
    """Return a function that begins a run before a wall."""
    begun = []

    def begin(robot, **options):
        begun.append(Guarded(robot, tmp_path, **options))
        return begun[-1]

    yield begin
    for each in begun:
        each.run.close()


def by_keys(guarded):
    if guarded.name == 'mbot':
        return lambda: guarded.run.press('i')
    for key, seconds in (('2', 1.2), ('4', 0.1)):
        guarded.run.press(key)
        guarded.go_on(seconds)
    for _ in range(20):
        guarded.run.press('w')
    return lambda: None


def by_velocity(source):
    def begin(guarded, speed=1.0):
        if guarded.name == 'go2' and guarded.robot.state != 'move base':
            for key, seconds in (
                ('2', 1.2 if guarded.robot.state == 'passive' else 1.0),
                ('5', 0.1),
            ):
                guarded.run.press(key)
                guarded.go_on(seconds)
        return lambda: guarded.robot.drive((speed, 0.0, 0.0), source)

    return begin


WAYS = {'keys': by_keys, 'page': by_velocity('page'), 'script': by_velocity('script')}


# A Go2 that walks by keys has room for the page then.
@pytest.mark.parametrize(
    ('robot', 'ways'), [*(('mbot', [way]) for way in WAYS), ('go2', ['keys', 'page'])]
)
def test_any_source_that_drives_it_stops_before_the_wall(begin, robot, ways):
    guarded = begin(robot)
    for way in ways:
        # Keys of mbot drive it slowly.
        seconds = 6.0 if robot == 'mbot' and way == 'keys' else 4.0
        assert KEPT < guarded.approach(WAYS[way](guarded), seconds) <= guarded.room < 0.2
        assert guarded.robot.drivers.state.guard in ('approach', 'stop')
        assert ' m ahead' in guarded.robot.status().message
        # And away from it again.
        if way != 'keys' or len(ways) > 1:
            source = 'page' if way == 'keys' else way
            guarded.repeat(by_velocity(source)(guarded, -0.3), 1.5)
            assert guarded.room > 0.4
            assert guarded.robot.drivers.state.guard == ''


@pytest.mark.parametrize('robot', ['mbot', 'go2'])
def test_without_a_guard_it_drives_into_it(begin, robot):
    guarded = begin(robot, guard=False)
    guarded.repeat(by_velocity('page')(guarded), 3.0)
    assert guarded.room < KEPT


def test_far_from_everything_it_drives_as_without_a_guard(begin):
    places = []
    for guard in (True, False):
        guarded = begin('mbot', guard=guard)
        guarded.go_on(0.4)
        guarded.repeat(lambda run=guarded: run.robot.drive((-0.5, 0.0, 0.5), 'page'), 1.5)
        places.append(guarded.run.world.base().position.copy())
    assert np.array_equal(*places)


@pytest.mark.parametrize('ramp', [1.0, math.nan], ids=['a ramp', 'no ramp'])
def test_weak_motors_stop_a_heavy_robot_before_the_wall(begin, tmp_path, ramp):
    file = tmp_path / 'heavy.urdf'
    file.write_text(HEAVY)
    guarded = begin('mbot', description=str(file))
    guarded.robot.drive_unit.parameters = guarded.robot.settings.changed(
        {'linear.x.max_acceleration': ramp}
    )
    nearest = guarded.approach(by_velocity('page')(guarded, 0.5), 10.0)
    assert KEPT < nearest <= guarded.room < 0.3
    assert guarded.robot.braking[0] == pytest.approx(0.19, abs=0.01)
    assert guarded.robot.drive_limits['forward_acceleration'] < 0.19


def test_a_limit_of_jerk_set_while_it_drives_is_braked_by(begin):
    guarded = begin('mbot')
    guarded.repeat(by_velocity('page')(guarded, -0.1), 0.5)
    guarded.robot.drive_unit.parameters = guarded.robot.settings.changed(
        {'linear.x.max_jerk': 0.3}
    )
    nearest = guarded.approach(by_velocity('page')(guarded, 1.0), 8.0)
    assert KEPT < nearest <= guarded.room < 0.4


def test_after_a_rest_it_walks_at_once(begin):
    guarded = begin('go2')
    for key, seconds in (('2', 6.0), ('5', 0.0)):
        guarded.run.press(key)
        guarded.go_on(seconds)
    guarded.repeat(lambda: guarded.robot.drive((-0.3, 0.0, 0.0), 'page'), 0.1)
    assert guarded.robot.drivers.state.guard == ''


def test_a_lidar_that_falls_silent_stops_it(begin, monkeypatch):
    guarded = begin('mbot')
    away = lambda: guarded.robot.drive((-0.3, 0.0, 0.0), 'page')  # noqa: E731
    guarded.repeat(away, 1.0)
    assert guarded.run.world.base().planar_velocity[0] < -0.2
    monkeypatch.setattr(guarded.run.guards[0].unit, 'see', lambda *_: None)
    guarded.repeat(away, 1.5)
    assert abs(guarded.run.world.base().planar_velocity[0]) < 0.01
    assert guarded.robot.status().message.startswith(
        'guard, stop: the lidar is silent or blind for'
    )


def test_a_robot_without_a_lidar_cannot_be_guarded():
    options = RunOptions(robot='mbot', description='mbot_bare', preset='mbot', guard=True)
    with pytest.raises(UserError, match='--guard: mbot.* has no planar lidar'):
        Run(options)


@pytest.mark.parametrize('robot', ['mbot', 'go2'])
def test_a_way_has_as_much_room_as_the_guard_keeps(begin, robot):
    guarded = begin(robot)
    kept = guarded.run.guards[0].unit._parameters.footprint_padding
    settings = NavigatorParameters().changed(_settings(guarded.robot))
    assert HARD * settings.planning.margin >= kept - 1e-9
    if robot == 'mbot':  # noise of its lidar does not let the guard stop it on its way
        assert HARD * settings.planning.margin == pytest.approx(kept + NOISE)


def test_odometry_that_is_set_again_forgets_no_wall(begin):
    guarded = begin('mbot')
    drive = by_velocity('page')(guarded, 0.5)
    assert KEPT < guarded.approach(drive, 5.0) <= guarded.room < 0.2
    for pose in ((5.0, 3.0, 1.0), (0.0, 0.0, 3.0), (-2.0, 0.0, 0.0)):
        guarded.robot.drive_unit.controller.set_odometry(*pose, PlanarCovariance())
        guarded.repeat(drive, 0.5)
    assert guarded.room > KEPT
