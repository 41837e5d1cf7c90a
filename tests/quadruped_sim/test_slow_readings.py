# SPDX-License-Identifier: Apache-2.0
"""A robot whose readings begin to come too slowly while it moves stops and stands."""

from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from quadruped_sim.leg_controller import LegController
from quadruped_sim.robot_model import JointMap
from robot_description.description import load_robot
from wasd_core.feed import Feed

pytestmark = pytest.mark.slow

USUAL, SLOW = 500.0, 50.0
WORDS = 'too slow'
# Of a Go2's base [m], and by how much it may tilt on the way there [rad].
STANDING = 0.35
UPRIGHT = 0.35
# A robot that tilts further has fallen [rad].
FALLEN = np.radians(60.0)


class Fed:
    """A Go2 whose controller gets a reading now and then, and knows how often."""

    def __init__(self, model, seed):
        loaded = load_robot('go2')
        self.world = build_world(loaded, 'flat', seed, usual_setup(loaded))
        self.controller = LegController(model)
        self._joints = JointMap(model.quadruped, self.world.joint_names, self.world.motor_names)
        self._feed, self._velocity = Feed(USUAL), (0.0, 0.0, 0.0)
        self.tilt = 0.0

    def run(self, seconds, rate=USUAL, velocity=None):
        """Let time pass [s] with so many readings a second, driving in move base."""
        for _ in range(round(seconds * rate)):
            self._feed.take(self.world.time)
            self.controller.hindrance = WORDS if self._feed.is_slow else ''
            if velocity is not None:
                self.controller.set_velocity(*velocity)
            reading = self._joints.reading(self.world.read())
            self.world.apply(self._joints.command(self.controller.step(reading, 1.0 / rate)))
            self.world.step(round(1.0 / rate / self.world.time_step))
            self.tilt = max(self.tilt, self.world.base().tilt)

    def stand(self):
        self.controller.press('2')
        self.run(1.3)


@pytest.mark.parametrize(
    ('velocity', 'seed'), [((0.5, 0.0, 0.0), 1), ((1.0, 0.3, 1.0), 2), ((2.0, 0.0, 0.0), 1)]
)
def test_one_that_walks_stops_and_stands_and_may_walk_again(model, velocity, seed):
    dog = Fed(model, seed)
    dog.stand()
    dog.controller.press('5')
    dog.run(2.0, velocity=velocity)
    dog.run(2.8, SLOW, velocity)
    assert dog.controller.state == 'fixed stand'
    assert np.linalg.norm(dog.world.base().linear_velocity) < 0.05
    assert dog.world.base().position[2] == pytest.approx(STANDING, abs=0.03)
    assert dog.tilt < UPRIGHT
    assert dog.controller.press('4') == WORDS
    dog.run(0.3, SLOW)
    assert dog.controller.state == 'fixed stand'
    dog.run(0.2)
    assert dog.controller.press('5') is None
    dog.run(1.0, velocity=(0.5, 0.0, 0.0))
    assert dog.world.base().planar_velocity[0] == pytest.approx(0.5, abs=0.1)
    assert dog.tilt < UPRIGHT


def test_no_key_leads_one_that_stands_anywhere_but_down(model):
    dog = Fed(model, 1)
    dog.stand()
    dog.run(0.5, SLOW)
    for key in '340986v7':
        said = dog.controller.press(key)
        dog.run(0.5, SLOW)
        if key == '7':
            assert (said, dog.controller.state) == (None, 'lie down')
        else:
            assert (said, dog.controller.state) == (WORDS, 'fixed stand'), key


def test_one_that_does_anything_but_stand_stands_again(model):
    """A jump is ended in its take-off and in the air, too."""
    dog = Fed(model, 1)
    dog.stand()
    for key, after in (*((key, 1.0) for key in '3098'), ('v', 0.5), ('v', 0.7)):
        assert dog.controller.press(key) is None, key
        dog.run(after)
        dog.run(2.5, SLOW)
        assert dog.controller.state == 'fixed stand', key
        assert dog.world.base().position[2] == pytest.approx(STANDING, abs=0.03), key
        # Who comes down from a jump that was ended in the air leans on landing, by up to 25 deg.
        assert dog.tilt < (FALLEN if key == 'v' else UPRIGHT), key
        dog.run(0.3)  # readings are quick again


def test_one_that_is_halting_when_readings_become_slow_does_not_fall(model):
    dog = Fed(model, 1)
    dog.stand()
    dog.controller.press('5')
    dog.run(2.0, velocity=(2.0, 0.0, 0.0))
    dog.controller.press('2')
    dog.run(0.1)
    dog.run(2.8, SLOW)
    assert dog.controller.state == 'fixed stand'
    assert dog.tilt < UPRIGHT


def test_one_that_lies_may_stand(model):
    dog = Fed(model, 1)
    dog.run(0.5, SLOW)
    assert dog.controller.press('2') is None
    dog.run(4.0, SLOW)
    assert dog.controller.state == 'fixed stand'
    assert dog.world.base().position[2] == pytest.approx(STANDING, abs=0.03)
