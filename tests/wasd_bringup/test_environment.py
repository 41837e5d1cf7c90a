# SPDX-License-Identifier: Apache-2.0
"""The Gymnasium environment: the API's own check, equal bits, what it shows and rewards."""

import copy
from ctypes.util import find_library
from dataclasses import replace
import os
from pathlib import Path
import pickle
import subprocess
import sys
import warnings

import mujoco
from mujoco_sim.parameters import Drawn
from mujoco_sim.scene import AHEAD, EDGE
import numpy as np
from physics_steps import steps_taken
from policy_player.onnx_writer import write_layers
from policy_player.policy_file import read_policy
from programs import run
import pytest
from terminals import PATIENCE
import wasd

gymnasium = pytest.importorskip('gymnasium')
from gymnasium.utils.env_checker import check_env  # noqa: E402
from wasd.environment import DEFAULT, Go2Environment, NAME, PHYSICS_STEPS, SPEC, WITH_HEIGHTS  # noqa: E402
from wasd_core.errors import UserError  # noqa: E402

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope='module')
def env():
    env = gymnasium.make(NAME)
    yield env
    env.close()


def play(env, seed: int, steps: int = 60) -> list:
    """Return all that an environment says to the same actions."""
    rng = np.random.default_rng(7)
    observation, _ = env.reset(seed=seed)
    said = [observation]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, 12))
        said += [observation, reward, terminated, truncated, *info['truth']]
    return said


def test_gymnasiums_own_check_finds_nothing(env):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        check_env(gymnasium.make(NAME, disable_env_checker=True).unwrapped)


def test_a_copy_begins_anew_and_then_does_the_same():
    env = Go2Environment('rough:0.05', randomise=0.5, command=(0.5, 0.0, 0.0))
    env.reset(seed=5)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        for one, two in zip(play(env, 3, 20), play(other, 3, 20), strict=True):
            np.testing.assert_array_equal(one, two)


def test_the_same_seed_gives_the_same_bits_and_another_does_not(env):
    first, second, other = play(env, 3), play(env, 3), play(env, 4)
    fresh = play(gymnasium.make(NAME), 3)
    for one, two, three in zip(first, second, fresh, strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)
    assert any(not np.array_equal(one, two) for one, two in zip(first, other, strict=True))


def test_who_does_nothing_stands_and_is_not_rewarded_for_what_is_asked(env):
    rewards = {}
    for speed in (0.0, 1.0):
        env.reset(seed=1, options={'command': (speed, 0.0, 0.0)})
        for _ in range(100):
            observation, reward, terminated, truncated, info = env.step(np.zeros(12))
            assert not (terminated or truncated)
        rewards[speed] = reward
        assert info['truth'].tilt < 0.25
        np.testing.assert_allclose(observation[6:9], (speed, 0.0, 0.0))
    assert rewards[0.0] > 0.8
    assert rewards[1.0] < 0.2


def test_a_fall_ends_an_episode_and_twenty_seconds_do(env):
    env.reset(seed=1)
    folded = np.tile((0.0, 1.0, -1.0), 4)
    for _ in range(200):
        _, _, terminated, _, info = env.step(folded)
        if terminated:
            break
    assert terminated
    assert env.spec.max_episode_steps * SPEC.period == 20.0


def test_no_episode_of_a_robot_that_is_upright_and_high_ends(env):
    env.action_space.seed(1)
    ends = 0
    for seed in range(12):
        env.reset(seed=seed)
        for _ in range(60):
            _, _, terminated, _, info = env.step(env.action_space.sample())
            if terminated:
                ends += 1
                truth = info['truth']
                assert truth.tilt > 0.5 or truth.position[2] < 0.2
                break
    assert ends > 0


def test_robots_differ_by_episode_as_much_as_is_asked():
    env = gymnasium.make(NAME, randomise=1.0)
    masses = []
    for seed in (1, 2, 1):
        env.reset(seed=seed)
        masses.append(float(env.unwrapped._world.model.body_mass.sum()))
    assert masses[0] == masses[2] != masses[1]


@pytest.mark.parametrize('physics_step', PHYSICS_STEPS[1:])
def test_readings_are_as_late_as_was_drawn(monkeypatch, physics_step):
    drawn = Drawn(sensor_delay=0.002)
    monkeypatch.setattr(wasd.environment, 'draw', lambda setup, *_: replace(setup, drawn=drawn))
    env = gymnasium.make(NAME, randomise=1.0, noise=False, physics_step=physics_step)
    env.reset(seed=1)
    world, order = env.unwrapped._world, env.unwrapped._joints
    for _ in range(10):
        observation, *_ = env.step(env.action_space.sample())
        joints = world.joints()
        before = joints.position - 0.002 * joints.velocity  # as MuJoCo integrates
        assert np.abs(joints.velocity).max() > 1.0
        np.testing.assert_allclose(observation[9:21] + DEFAULT, before[order], atol=1e-6)


def test_the_true_heights_ahead_of_stairs_follow_what_else_is_shown():
    env = gymnasium.make(NAME, world='step:0.1', heights=True)
    observation, _ = env.reset(seed=1)
    assert observation.shape == (WITH_HEIGHTS.width,) == (45 + 187,)
    world = env.unwrapped._world
    here = AHEAD + EDGE - 0.55  # where the step is, is at random
    world.data.qpos[world.parts.pose][:2] = here, 0.0
    mujoco.mj_forward(world.model, world.data)
    observation, *_ = env.step(np.zeros(12))
    base = world.base().position
    x = base[0] + np.linspace(-0.8, 0.8, 17)
    shown = observation[45:].reshape(11, 17)  # x is fastest
    np.testing.assert_allclose(shown[:, x < AHEAD - 0.02], base[2] - 0.5, atol=0.01)
    np.testing.assert_allclose(shown[:, x > AHEAD + EDGE + 0.02], base[2] - 0.6, atol=0.01)
    assert (x > AHEAD + EDGE + 0.02).any()


def test_a_wrong_argument_is_said_in_a_line():
    with pytest.raises(UserError, match='render_mode'):
        gymnasium.make(NAME, render_mode='ansi', disable_env_checker=True)
    with pytest.raises(UserError, match=r'physics_step: got 0.003, wanted 0.001, 0.002 or 0.004'):
        gymnasium.make(NAME, physics_step=0.003, disable_env_checker=True)


@pytest.mark.skipif(find_library('OSMesa') is None, reason='no OSMesa')
def test_a_script_that_does_not_close_what_draws_by_osmesa_ends_without_a_word():
    made = "from wasd.environment import *; env = Go2Environment(render_mode='rgb_array')"
    ended = run(
        (sys.executable, '-c', f'{made}; env.reset(); env.render()'),
        timeout=PATIENCE,
        env=os.environ | dict.fromkeys(('MUJOCO_GL', 'PYOPENGL_PLATFORM'), 'osmesa'),
    )
    assert (ended.returncode, ended.stderr) == (0, b'')


@pytest.mark.skipif(find_library('OSMesa') is None, reason='no OSMesa')
def test_a_fork_of_a_process_that_has_drawn_by_osmesa_ends_as_it_wants_to():
    script = """
import os, sys
from wasd.environment import *
env = Go2Environment(render_mode='rgb_array')
env.reset()
env.render()
child = os.fork()
if not child:
    print('bye')
    sys.exit(3)
env.render()
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    ended = run(
        (sys.executable, '-c', script),
        timeout=PATIENCE,
        env=os.environ | dict.fromkeys(('MUJOCO_GL', 'PYOPENGL_PLATFORM'), 'osmesa'),
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b'bye\n3\n', b'')


def trot(time: float) -> np.ndarray:
    """Return an action of an open-loop trot at 2.5 Hz, which turns a little and goes on."""
    phase = 2.0 * np.pi * (2.5 * time + np.array((0.0, 0.5, 0.5, 0.0)))
    lift = np.maximum(np.sin(phase), 0.0)
    return np.stack((0.1 * np.cos(phase), 0.35 * np.cos(phase), -0.7 * lift), axis=1).ravel()


def test_a_long_physics_step_moves_the_robot_as_a_short_one():
    ends = []
    for physics_step in PHYSICS_STEPS:
        env = gymnasium.make(NAME, physics_step=physics_step, noise=False)
        _, info = env.reset(seed=1)
        started = info['truth'].position
        for step in range(250):
            *_, info = env.step(trot(step * SPEC.period))
        ends.append(info['truth'])
        assert np.linalg.norm(info['truth'].position - started) > 0.1
    short, *longer = ends
    for long in longer:
        np.testing.assert_allclose(long.position, short.position, atol=0.03)
        assert abs(long.rpy - short.rpy).max() < 0.05


def test_physics_steps_as_told_but_for_those_around_the_beginning_of_a_command():
    for physics_step, wanted in (
        (0.001, [1] * 20),
        (0.002, [2] * 10),
        (0.004, [2, 2, 4, 4, 4, 4]),
    ):
        env = gymnasium.make(NAME, physics_step=physics_step)
        env.reset(seed=1)
        with steps_taken() as taken:
            env.step(np.zeros(12))
        assert taken == wanted


def test_a_network_of_the_environment_is_written_and_read_as_it_was_trained(tmp_path):
    write_layers(str(tmp_path / 'a.onnx'), SPEC, [(np.zeros((12, SPEC.width)), np.zeros(12))])
    spec = read_policy(tmp_path / 'a.onnx').spec
    assert replace(spec, source=NAME, assumed=()) == SPEC


def test_what_the_documented_script_learns_is_played_as_it_was_trained(tmp_path):
    pytest.importorskip('stable_baselines3')
    file = tmp_path / 'learned.onnx'
    command = [sys.executable, ROOT / 'docs/examples/train_ppo.py', '4096', file]
    subprocess.run(command, check=True, capture_output=True)
    spec = read_policy(file).spec
    assert replace(spec, source=NAME, assumed=()) == SPEC
    dog = wasd.Go2(policy=file)
    dog.press('2')
    dog.run(2.5)
    dog.press('p')
    dog.run(3.0)
    assert dog.state == 'policy'
