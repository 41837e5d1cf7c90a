# SPDX-License-Identifier: Apache-2.0
"""The policy that comes along: it walks, turns, takes a push, and is left and entered again."""

import numpy as np
from policy_player.policy_file import OWN, read_policy
from policy_player.usual import oddities
import pytest
from teleop_keyboard.key_script import parse_key_script
import wasd
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

from mujoco_sim import simulation
from policy_player import first_look

pytest.importorskip('onnxruntime')


def test_it_is_small_and_says_all_of_itself():
    assert OWN['ours'].stat().st_size < 1_000_000
    policy = read_policy('ours')
    assert policy.config == ''
    assert policy.spec.width == 38
    # It knows the estimate that it walks with here.
    assert all('estimate of the legs' in told for told in oddities(policy.spec))


def test_no_other_process_looks_at_it_first(monkeypatch):
    """As one does at a stranger's network, in a quarter of a second."""
    monkeypatch.setattr(first_look, 'subprocess', None)
    assert read_policy('ours').network.gives == 12
    with pytest.raises(AttributeError):
        first_look.look(OWN['ours'].with_name('..') / 'networks' / 'ours.onnx', 38)


@pytest.mark.slow
def test_it_walks_turns_takes_a_push_and_gives_way_to_the_legs_while_it_moves():
    dog = wasd.Go2(seed=31, policy='ours')
    dog.press('2')
    dog.run(1.3)
    dog.press('p')
    dog.run(1.5)
    found = {}
    for velocity in ((1.0, 0.0, 0.0), (0.0, 0.0, 0.5)):
        dog.drive(*velocity)
        dog.run(2.0)
        start, seen = dog.time, []
        while dog.time - start < 1.6:
            dog.run(0.05)
            seen.append(dog.truth.planar_velocity)
        found[velocity] = np.mean(seen, axis=0)
    for velocity, mean in found.items():
        np.testing.assert_allclose(mean, velocity, atol=0.15)
    dog.drive(0.5)
    dog.run(1.0)
    dog.push((0.0, 150.0, 0.0), 0.1)
    dog.run(2.0)
    assert dog.state == 'policy'
    dog.press('2')  # at 0.5 m/s
    dog.run(3.0)
    assert dog.state == 'fixed stand'
    assert dog.truth.tilt < 0.1
    dog.press('p')
    dog.run(1.5)
    dog.drive(0.8)
    dog.run(1.5)
    dog.press('1')
    dog.run(1.5)
    assert dog.state == 'passive'
    assert dog.truth.tilt < 0.5


@pytest.mark.slow
def test_instants_in_which_nobody_acts_are_left_out_without_changing_a_bit(monkeypatch):
    keys = tuple(parse_key_script('0.1 2\n2.4 p\n3.5 w*5\n3.804 a', 'keys'))
    samples = []
    for most in (1, simulation.MOST_STRIDES):
        monkeypatch.setattr(simulation, 'MOST_STRIDES', most)
        options = RunOptions(
            robot='go2', description='go2', preset='unitree', policy='ours', keys=keys, speed=0.0
        )
        run, seen = Run(options), set()
        step = run.world.physics.step
        monkeypatch.setattr(
            run.world.physics, 'step', lambda n, step=step, seen=seen: (seen.add(n), step(n))
        )
        run.simulation.advance(4200)
        assert (max(seen) == 10) == (most > 1)
        samples.append(run.report()['samples'])
        run.close()
    assert samples[0] == samples[1]


@pytest.mark.slow
def test_p_pressed_while_a_run_halts_waits_for_the_halt():
    """Stiff legs throw a robot at 2 m/s onto its back, at some phases of its steps."""
    dog = wasd.Go2(seed=1, policy='ours')
    for phase in (1, 2, 3):
        dog.reset()
        for key, seconds in (('2', 1.3), ('4', 0.5), *[('w', 0.0)] * 20):
            dog.press(key)
            dog.run(seconds)
        dog.run(2.0 + 0.05 * phase)
        dog.press('2')
        dog.run(0.1)
        dog.press('p')
        tilts = []
        for _ in range(24):
            dog.run(0.05)
            tilts.append(dog.truth.tilt)
        assert dog.state == 'policy'
        assert max(tilts) < 0.3


@pytest.mark.slow
def test_odometry_rises_with_a_network_that_walks_up_a_slope():
    dog = wasd.Go2('slope:5', seed=1, policy='ours')
    for key, seconds in (('2', 1.3), ('p', 1.2)):
        dog.press(key)
        dog.run(seconds)
    start = dog.truth.position[2] - dog.odometry.position[2]
    dog.drive(0.8)
    dog.run(3.5)
    assert dog.truth.position[2] > 0.4
    assert dog.truth.position[2] - dog.odometry.position[2] == pytest.approx(start, abs=0.05)
