# SPDX-License-Identifier: Apache-2.0
"""What feet carry, and what is done with it: no test of the QP tips a robot over, or is tipped."""

import math

import numpy as np
import pytest
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.exercises import NARROW
from quadruped_sim.states.support import (
    corners_of,
    distances_inside,
    is_to_step,
    middle_of,
    nearest_inside,
    room_inside,
)
from wasd import Go2

pytestmark = pytest.mark.long

# Legs of 3, 4 and 5: the incircle has radius 1 and its centre 1 from both short sides.
RIGHT_ANGLED = np.array(((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)))
FEET = np.array(((0.2, 0.1, 0.0), (0.2, -0.1, 0.0), (-0.2, 0.1, 0.0), (-0.2, -0.1, 0.0)))
# A robot that is told to stand does so after a second [s].
UP = 1.3
# The third and fourth fold the leg under the belly.
ENDS = ('w*20 d*20', 'a*40', 's*40 i*20', 'd*40 k*40', 'w*40')


def test_the_middle_of_a_triangle_is_the_centre_of_its_incircle():
    np.testing.assert_allclose(middle_of(RIGHT_ANGLED), (1.0, 1.0), atol=1e-12)
    assert room_inside(RIGHT_ANGLED) == pytest.approx(1.0)
    np.testing.assert_allclose(distances_inside(np.array((1.0, 1.0)), RIGHT_ANGLED), 1.0)


def test_corners_go_around_the_feet_that_stand_whichever_they_are():
    for lifted in range(4):
        corners = corners_of(FEET, np.arange(4) != lifted)
        assert len(corners) == 3
        assert room_inside(corners) > 0.0
    assert room_inside(corners_of(FEET, np.ones(4, dtype=bool))) == pytest.approx(0.1)


def test_a_point_is_moved_inside_by_the_shortest_way_and_no_farther(rng):
    inside = np.array((1.2, 0.9))
    np.testing.assert_array_equal(nearest_inside(inside, RIGHT_ANGLED, 0.5), inside)
    moved = nearest_inside(np.array((1.5, -2.0)), RIGHT_ANGLED, 0.5)
    np.testing.assert_allclose(moved, (1.5, 0.5), atol=1e-9)
    for point in rng.uniform(-9.0, 9.0, (50, 2)):
        nearest = nearest_inside(point, RIGHT_ANGLED, 0.7)
        assert distances_inside(nearest, RIGHT_ANGLED).min() > 0.7 - 1e-3
    np.testing.assert_allclose(nearest_inside(point, RIGHT_ANGLED, 2.0), (1.0, 1.0), atol=1e-12)


def moving(*, R: np.ndarray, **motion: np.ndarray) -> RobotState:
    """Return a robot that stands on FEET and moves."""
    robot = RobotState.blank()
    robot.base.R[:], robot.feet[:], robot.com[:] = R, FEET, motion.pop('com')
    for name, value in motion.items():
        getattr(robot.base, name)[:] = value
    return robot


@pytest.mark.parametrize('way', [(0.2, 1.0, 0.0), (0.2, -1.0, 0.0), (0.1, 0.0, 1.0)])
def test_a_step_is_due_once_the_capture_point_leaves_the_feet(way):
    """At 9.81 / 4 m of height the point is ahead by half of a second's way."""
    far, *direction = way
    for share in (0.99, 1.01):
        velocity = 2.0 * far * share * np.array((*direction, 0.0))
        where = {'position': np.array((0.0, 0.0, 9.81 / 4.0)), 'com': np.zeros(3)}
        robot = moving(R=np.eye(3), velocity=velocity, omega=np.zeros(3), **where)
        assert is_to_step(robot, np.ones(4, dtype=bool), 9.81) == (share > 1.0)


def test_a_step_is_due_as_the_corners_say_however_the_robot_turns(rng):
    found = set()
    for _ in range(300):
        R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        position, com = rng.normal(0.0, 0.1, 3) + (0.0, 0.0, 0.3), rng.normal(0.0, 0.05, 3)
        velocity, omega = rng.normal(0.0, 0.5, 3), rng.normal(0.0, 0.5, 3)
        robot = moving(R=R, position=position, com=com, velocity=velocity, omega=omega)
        stands = np.arange(4) != rng.integers(5)
        arm = R @ com
        height = position[2] + arm[2] - FEET[stands, 2].mean()
        carried = velocity + np.cross(R @ omega, arm)
        point = (position + arm)[:2] + carried[:2] * math.sqrt(max(height, 0.0) / 9.81)
        due = bool(distances_inside(point, corners_of(FEET, stands)).min() < 0.0)
        assert is_to_step(robot, stands, 9.81) == due
        found.add(due)
    assert found == {True, False}


def press(dog: Go2, keys: str) -> None:
    """Press keys as a script has them: `w*5 9`."""
    for word in keys.split():
        key, _, count = word.partition('*')
        for _ in range(int(count or 1)):
            dog.press(key)


def walked(seed: int, keys: str) -> Go2:
    """Return a robot that has walked as keys say and stands again, wherever its feet stopped."""
    dog = Go2(seed=seed)
    for words, seconds in (('2', UP), ('4', 0.3), (keys, 1.5), ('2', 1.0)):
        press(dog, words)
        dog.run(seconds)
    return dog


def steepest(dog: Go2, seconds: float) -> float:
    """Run and return the largest roll or pitch on the way [deg]."""
    worst = 0.0
    for _ in range(round(seconds / 0.05)):
        dog.run(0.05)
        worst = max(worst, float(np.abs(dog.truth.rpy[:2]).max()))
    return math.degrees(worst)


@pytest.mark.slow
def test_after_a_walk_it_stays_level_with_the_sticks_at_their_ends():
    """A small sample of `swing` in benchmarks/legs_states.py."""
    dog = walked(2000, 'w*8 l*5')
    for test, state in (('9', 'swing test'), ('2', 'fixed stand'), ('0', 'balance test')):
        dog.press(test)
        dog.run(1.0 if test == '2' else 0.0)
        for ends in ENDS if test != '2' else ():
            press(dog, ends)
            assert steepest(dog, 1.0) < 10.0
        assert dog.state == state
        assert dog.truth.position[2] > 0.25


@pytest.mark.slow
@pytest.mark.parametrize('test', ['9', ''])
def test_pushes_of_15_newton_seconds_make_it_step_and_go_on(test):
    dog = Go2(seed=2001)
    for key in f'2{test}':
        dog.press(key)
        dog.run(UP if key == '2' else 1.5)  # the foot is up then
    state = dog.state
    for force in ((150.0, 0.0, 0.0), (0.0, 150.0, 0.0)):
        dog.push(force, 0.1)
        assert steepest(dog, 2.0) < 45.0
        assert dog.state == state
        assert steepest(dog, 0.3) < 5.0


@pytest.mark.slow
@pytest.mark.parametrize('test', '09')
def test_a_test_that_is_asked_for_on_the_ground_begins_once_it_stands(test):
    dog = Go2(seed=2002)
    dog.run(0.1)
    for key in f'2{test}':
        dog.press(key)
        dog.run(0.01)
    dog.run(2.0)
    assert dog.truth.position[2] > 0.25


def narrowest(dog: Go2) -> float:
    """Return the smallest radius of the incircles of three feet [m]."""
    assert dog._robot.legs.controller.robot is not None
    feet = dog._robot.legs.controller.robot.feet
    return min(room_inside(corners_of(feet, np.arange(4) != lifted)) for lifted in range(4))


@pytest.mark.slow
def test_feet_that_stand_close_together_are_put_below_the_hips_first():
    dog = Go2(seed=2003)
    press(dog, '2')
    dog.run(UP)
    press(dog, '9 a*20')
    while narrowest(dog) > NARROW:
        dog.run(0.1)
        assert dog.time < UP + 4.0
    dog.press('2')
    dog.run(0.02)
    assert narrowest(dog) < NARROW
    dog.press('9')
    dog.run(1.0)
    assert narrowest(dog) > 0.075


@pytest.mark.slow
@pytest.mark.parametrize(('state', 'side'), [('', 1.0), ('8', -1.0)])
def test_key_1_after_a_push_lowers_the_robot_and_does_not_tip_it(state, side):
    dog = Go2(seed=2004)
    for key in f'2{state}':
        dog.press(key)
        dog.run(UP if key == '2' else 3.2)
    dog.push((0.0, side * 150.0, 0.0), 0.1)
    dog.run(0.18)
    dog.press('1')
    assert steepest(dog, 2.2) < 30.0
    assert dog.state == 'passive'
    assert dog.truth.position[2] < 0.15


@pytest.mark.slow
@pytest.mark.parametrize('keys', ['s*20', 'w*15 l*15'])
def test_key_1_at_speed_lowers_the_robot_and_does_not_tip_it(keys):
    dog = Go2(seed=2005)
    for words, seconds in (('2', UP), ('4', 0.2), (keys, 2.0), ('1', 0.0)):
        press(dog, words)
        dog.run(seconds)
    assert steepest(dog, 2.2) < 30.0
    assert dog.state == 'passive'


def with_a_foot_in_the_air() -> Go2:
    """Return a robot in the step test, found by benchmarks/state_pairs.py."""
    dog = Go2(seed=1000)
    for seconds, keys in ((0.2, '2'), (3.5, '8'), (2.5, 'w*5'), (0.5, 'SPACE')):
        dog.run(seconds)
        press(dog, keys)
    dog.run(0.7)
    return dog


@pytest.mark.slow
def test_key_1_lowers_one_that_stands_on_three_feet_level():
    dog = with_a_foot_in_the_air()
    dog.press('1')
    assert steepest(dog, 2.2) < 15.0
    assert dog.state == 'passive'


@pytest.mark.slow
def test_one_that_leans_on_a_leg_as_it_lies_folds_first_and_stands():
    """Straight up it tipped over."""
    dog = with_a_foot_in_the_air()
    dog._robot.legs.controller.e_stop()  # limp at once, on that leg
    dog.run(2.0)
    assert dog.state == 'passive'
    assert math.degrees(np.abs(dog.truth.rpy[:2]).max()) > 28.0
    dog.press('2')
    dog.run(3.0)
    assert dog.state == 'fixed stand'
    assert dog.truth.position[2] > 0.3


def test_a_push_off_the_centre_does_not_tip_the_balance_test_over():
    robot = Go2('flat', 5)
    robot.press('2')
    robot.run(UP)
    robot.press('0')
    robot.run(0.4)
    robot.push((30.0, 110.0, 0.0), 0.15, (-0.2, 0.0, 0.1))
    for _ in range(12):
        robot.run(0.1)
        _, x, y, _ = robot.truth.orientation
        assert 1.0 - 2.0 * (x * x + y * y) > math.cos(math.radians(20.0))
    assert robot.state == 'balance test'
