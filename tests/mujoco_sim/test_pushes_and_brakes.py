# SPDX-License-Identifier: Apache-2.0
"""What acts on the robot besides commands: pushes, and motors that brake."""

import math

from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_core.errors import SimulationError
from wasd_core.robot_io import JointCommand

LIMP = JointCommand(*np.zeros((5, 2)))


def test_a_reset_ends_a_push(ball):
    ball.push((1.0, 0.0, 0.0), 1.0)
    ball.step(10)
    ball.reset()
    ball.step(100)
    np.testing.assert_array_equal(ball.base().linear_velocity, np.zeros(3))


@pytest.mark.parametrize('force', [(4.0, 0.0, 0.0), (0.0, -3.0, 1.0)])
@pytest.mark.parametrize('steps', [1, 7, 100])
def test_a_push_gives_its_momentum_and_ends(ball, force, steps):
    duration = 0.001 * steps
    ball.push(force, duration)
    ball.step(250)
    expected = np.array(force) * duration / 2.0
    np.testing.assert_allclose(ball.base().linear_velocity, expected, rtol=1e-9, atol=1e-15)


def test_a_push_beyond_what_can_be_solved_ends_the_run_and_says_when(
    ball, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    ball.step(3)
    ball.push((1e12, 0.0, 0.0), 0.1)
    with pytest.raises(SimulationError, match=r'the physics diverged at 0\.00[45] s'):
        ball.step(2)
    # MuJoCo by itself says it once more, and writes a log into the user's folder.
    assert (capfd.readouterr().err, list(tmp_path.iterdir())) == ('', [])


def test_a_push_acts_at_the_centre_of_mass(ball):
    ball.push((1.0, 2.0, 3.0), 0.1)
    ball.step(200)
    np.testing.assert_allclose(ball.base().angular_velocity, np.zeros(3), atol=1e-12)


def test_a_push_off_the_centre_turns_the_robot_by_its_moment(ball):
    # 2 N upward for 100 ms at 0.1 m to the left of the centre: about x, 0.02 N m s on 0.1 kg m^2.
    ball.push((0.0, 0.0, 2.0), 0.1, (0.0, 0.1, 0.0))
    ball.step(200)
    np.testing.assert_allclose(ball.base().angular_velocity, (0.2, 0.0, 0.0), rtol=1e-3)
    np.testing.assert_allclose(ball.base().linear_velocity, (0.0, 0.0, 0.1), rtol=1e-9)
    np.testing.assert_array_equal(ball.data.xfrc_applied, 0.0)


def test_the_point_of_a_push_turns_with_the_robot(ball):
    # Half a turn per second about z: what begins ahead is to the left, then behind.
    ball.data.qvel[5] = math.pi
    ball.push((0.0, 0.0, 0.02), 2.0, (0.1, 0.0, 0.0))
    ball.step(500)
    moment = ball.data.xfrc_applied[ball.root, 3:]
    np.testing.assert_allclose(moment, (0.002, 0.0, 0.0), atol=2e-5)
    ball.step(500)
    moment = ball.data.xfrc_applied[ball.root, 3:]
    np.testing.assert_allclose(moment, (0.0, 0.002, 0.0), atol=4e-5)


def test_pushes_at_the_same_time_add_up(ball):
    # 1 N for 50 ms, and from 20 ms on 3 N for 10 ms and 2 N to the left for 100 ms, on 2 kg.
    ball.push((1.0, 0.0, 0.0), 0.050)
    ball.step(20)
    ball.push((3.0, 0.0, 0.0), 0.010)
    ball.push((0.0, 2.0, 0.0), 0.100)
    ball.step(20)
    np.testing.assert_array_equal(ball.data.xfrc_applied[ball.root, :3], [1.0, 2.0, 0.0])
    ball.step(300)
    np.testing.assert_allclose(
        ball.base().linear_velocity,
        [(1.0 * 0.050 + 3.0 * 0.010) / 2.0, 2.0 * 0.100 / 2.0, 0.0],
        rtol=1e-9,
    )
    np.testing.assert_array_equal(ball.data.xfrc_applied, 0.0)


@pytest.mark.parametrize('every', [1, 33, 250])
def test_a_push_that_is_renewed_takes_the_place_of_its_last_and_adds_to_others(ball, every):
    # 4 N for a second, renewed every so often, and beside it 3 N upward for 100 ms, on 2 kg.
    ball.push((0.0, 0.0, 3.0), 0.1)
    for _ in range(0, 1000 - every, every):
        assert ball.keep_pushing((4.0, 0.0, 0.0))
        ball.step(every)
    ball.keep_pushing((4.0, 0.0, 0.0))
    ball.step(1000 - ball.tick)
    ball.keep_pushing((0.0, 0.0, 0.0))
    ball.step(100)
    np.testing.assert_allclose(ball.base().linear_velocity, (2.0, 0.0, 0.15), rtol=1e-9)
    np.testing.assert_array_equal(ball.data.xfrc_applied, 0.0)


def test_a_push_without_an_end_ends_at_a_reset(ball):
    ball.keep_pushing((1.0, 0.0, 0.0))
    ball.step(10)
    ball.reset()
    ball.push((0.0, 2.0, 0.0), 0.1)
    ball.step(200)
    np.testing.assert_allclose(ball.base().linear_velocity, (0.0, 0.1, 0.0), rtol=1e-9)


@pytest.mark.parametrize('force', [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (1.0, 0.0)])
def test_a_push_without_an_end_that_is_not_finite_is_refused_and_changes_nothing(ball, force):
    ball.keep_pushing((2.0, 0.0, 0.0))
    assert not ball.keep_pushing(force)
    ball.step(100)
    np.testing.assert_allclose(ball.base().linear_velocity, (0.1, 0.0, 0.0), rtol=1e-9)


@pytest.mark.parametrize(
    ('force', 'duration'),
    [
        ((math.nan, 0.0, 0.0), 0.1),
        ((0.0, math.inf, 0.0), 0.1),
        ((1.0, 0.0), 0.1),
        ((1.0, 0.0, 0.0), math.nan),
        ((1.0, 0.0, 0.0), math.inf),
    ],
)
def test_a_push_that_is_not_finite_is_refused_and_moves_nothing(ball, force, duration):
    assert not ball.push(force, duration)
    assert not ball.push((1.0, 0.0, 0.0), 0.1, (math.nan, 0.0, 0.0))
    assert not ball.push((1.0, 0.0, 0.0), 0.1, (0.0, 0.0))
    ball.step(10)
    np.testing.assert_array_equal(ball.base().linear_velocity, np.zeros(3))
    assert ball.push((2.0, 0.0, 0.0), 0.1)


@pytest.mark.parametrize('command', [None, LIMP])
def test_brakes_stop_the_robot_that_no_command_damps(world, command):
    world.step(100)
    if command is not None:
        world.apply(command)
    world.data.qvel[0] = 0.3
    world.data.qvel[6:8] = 0.3 / 0.06
    world.step(500)
    assert world.base().linear_velocity[0] > 0.28  # limp: it coasts
    world.brake()
    world.step(200)
    assert abs(world.base().linear_velocity[0]) < 1e-3


def test_brakes_stop_a_wheel_in_the_air_without_ringing(world):
    # The wheel's own inertia is all there is: the largest damping that is stable is 0.7 N m s.
    world.model.opt.gravity[:] = 0.0
    world.data.qpos[2] = 1.0
    world.data.qvel[6] = 5.0
    world.brake()
    speeds = []
    for _ in range(50):
        world.step()
        speeds.append(world.joints().velocity[0])
    assert np.diff(np.abs(speeds)).max() <= 0.0
    assert 0.0 <= speeds[-1] < 0.05


@pytest.mark.slow
def test_before_any_command_the_robot_stands_still_limp_or_braked(loaded):
    for brakes in (False, True):
        world = build_world(loaded)
        if brakes:
            world.brake()
        world.step(1000)
        np.testing.assert_allclose(world.base().position, np.zeros(3), atol=5e-5)
