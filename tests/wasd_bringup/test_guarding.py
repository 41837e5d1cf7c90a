# SPDX-License-Identifier: Apache-2.0
"""`--guard` in a run: for each source the robot stops before what its lidar sees."""

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


class Guarded:
    """A robot before a wall."""

    def __init__(self, robot, folder, guard=True):
        world = folder / 'wall.xml'
        world.write_text(WALL)
        preset = 'mbot' if robot == 'mbot' else 'unitree'
        options = RunOptions(
            robot=robot, description=robot, preset=preset, world=str(world), speed=0.0, guard=guard
        )
        self.run = Run(options)
        self.name, self.robot = robot, self.run.robot

    def go_on(self, seconds):
        self.run.simulation.advance(round(seconds / self.run.world.time_step))

    def repeat(self, act, seconds):
        for _ in range(round(seconds / 0.05)):
            act()
            self.go_on(0.05)

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
    for key, seconds in (('2', 2.5), ('4', 0.5)):
        guarded.run.press(key)
        guarded.go_on(seconds)
    for _ in range(20):
        guarded.run.press('w')
    return lambda: None


def by_velocity(source):
    def begin(guarded, speed=1.0):
        if guarded.name == 'go2' and guarded.robot.state != 'move base':
            for key, seconds in (
                ('2', 2.5 if guarded.robot.state == 'passive' else 1.0),
                ('5', 0.5),
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
        guarded.repeat(WAYS[way](guarded), 7.0 if way == 'keys' else 5.0)
        assert KEPT < guarded.room < 0.2
        assert guarded.robot.drivers.state.guard in ('approach', 'stop')
        assert ' m ahead' in guarded.robot.status().message
        # And away from it again.
        if way != 'keys' or len(ways) > 1:
            source = 'page' if way == 'keys' else way
            guarded.repeat(by_velocity(source)(guarded, -0.3), 2.0)
            assert guarded.room > 0.4
            assert guarded.robot.drivers.state.guard == ''


@pytest.mark.parametrize('robot', ['mbot', 'go2'])
def test_without_a_guard_it_drives_into_it(begin, robot):
    guarded = begin(robot, guard=False)
    guarded.repeat(by_velocity('page')(guarded), 4.0)
    assert guarded.room < KEPT


def test_far_from_everything_it_drives_as_without_a_guard(begin):
    places = []
    for guard in (True, False):
        guarded = begin('mbot', guard=guard)
        guarded.go_on(0.4)
        guarded.repeat(lambda run=guarded: run.robot.drive((-0.5, 0.0, 0.5), 'page'), 3.0)
        places.append(guarded.run.world.base().position.copy())
    assert np.array_equal(*places)


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
    assert guarded.robot.status().message.startswith('guard, stop: the lidar is silent for')


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
    guarded.repeat(drive, 5.0)
    assert KEPT < guarded.room < 0.2
    for pose in ((5.0, 3.0, 1.0), (0.0, 0.0, 3.0), (-2.0, 0.0, 0.0)):
        guarded.robot.drive_unit.controller.set_odometry(*pose, PlanarCovariance())
        guarded.repeat(drive, 0.5)
    assert guarded.room > KEPT
