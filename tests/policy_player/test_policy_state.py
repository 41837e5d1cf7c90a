# SPDX-License-Identifier: Apache-2.0
"""The state policy: p from the stand, 2 and 1 back, and what lets go."""

import dataclasses

from mujoco_sim.parameters import Drawn
import numpy as np
from physics_steps import steps_taken
from policy_files import constant, exporter, mjlab, MOTORS, onnx, rl_sar, torchscript, write
import pytest
from quadruped_sim.states.policy import SETTLE_TIME
import wasd
from wasd_bringup.run import worlds

HOME = [0.0, 0.8, -1.6] * 4


@pytest.fixture(scope='module')
def standing(tmp_path_factory):
    """A policy that holds its pose: what it says is always zero."""
    folder = tmp_path_factory.mktemp('standing')
    path = folder / 'policy.pt'
    path.write_bytes(torchscript(exporter(*constant(45, np.zeros(12)))))
    config = write(
        folder,
        'config.yaml',
        rl_sar(MOTORS, default_dof_pos=HOME, rl_kp=[60.0] * 12, rl_kd=[3.0] * 12),
    )
    return path, config


@pytest.fixture(scope='module')
def one(standing):
    """The robot of these tests, in the state in which the test before left it."""
    return wasd.Go2(seed=1, policy=standing[0], policy_config=standing[1])


@pytest.fixture
def dog(one):
    """That robot as it stands."""
    if one.state != 'fixed stand':
        one.press('2')
        one.run(1.3)
    return one


@pytest.fixture
def playing(one, request, monkeypatch):
    """That robot as its network has held it for a while; what a test has it say is forgotten."""
    if one.state != 'policy':
        request.getfixturevalue('dog').press('p')
        one.run(SETTLE_TIME + 0.5)
    walker = player(one)
    monkeypatch.setattr(walker, 'policy', walker.policy)
    return one


def player(dog):
    return dog._robot.legs.controller._states['policy']._walker


def say(dog, action):
    """Let the network say something else from now on."""
    walker = player(dog)
    walker.policy = walker.policy._replace(network=lambda shown: np.asarray(action))


@pytest.mark.slow
def test_p_plays_from_the_stand_2_stands_again_and_1_lets_go(dog):
    dog.press('p')
    dog.run(SETTLE_TIME + 1.0)
    assert dog.state == 'policy'
    np.testing.assert_allclose(dog._robot.world.joints().position, HOME, atol=0.15)
    dog.press('2')
    dog.run(2.0)
    assert dog.state == 'fixed stand'
    assert dog.truth.tilt < 0.05
    dog.press('p')
    dog.run(SETTLE_TIME + 0.2)
    dog.press('1')
    dog.run(1.5)
    assert dog.state == 'passive'
    assert dog.truth.tilt < 0.3


def share_of_long_steps(dog, seconds):
    """Run a dog; return the share of the time that passes in steps of physics of 2 ms."""
    with steps_taken() as taken:
        dog.run(seconds)
    return taken.count(2) * 0.002 / seconds


@pytest.mark.slow
def test_physics_takes_long_steps_while_the_network_walks_and_no_longer(dog):
    assert share_of_long_steps(dog, 0.3) == 0.0
    dog.press('p')
    dog.run(SETTLE_TIME + 0.1)
    assert share_of_long_steps(dog, 0.3) == pytest.approx(1.0)
    dog.press('2')
    dog.run(0.1)
    assert share_of_long_steps(dog, 0.3) == 0.0


@pytest.mark.slow
def test_p_leads_from_nowhere_but_the_stand_and_needs_a_policy(dog):
    dog.press('4')
    dog.run(0.5)
    with pytest.raises(wasd.UserError, match='press 2 to stand'):
        dog.press('p')
    other = wasd.Go2(seed=1)
    other.press('2')
    other.run(1.3)
    with pytest.raises(wasd.UserError, match='policy=FILE'):
        other.press('p')
    assert 'policy' not in [choice.name for choice in other._robot.choices()]
    assert 'policy' in [choice.name for choice in dog._robot.choices()]


@pytest.mark.slow
@pytest.mark.parametrize('bad', [np.full(12, np.nan), np.zeros(11)])
def test_a_network_that_says_no_number_ends_in_damping_and_a_line(playing, bad):
    height = playing.truth.position[2]
    say(playing, bad)
    playing.run(0.03)
    assert playing.state == 'passive'
    assert 'the output of the network is not a number' in playing._robot.legs.notice.text
    lowest = [height]
    for _ in range(12):
        playing.run(0.1)
        lowest.append(playing.truth.linear_velocity[2])
        assert playing.truth.tilt < 0.5
    assert min(lowest) > -1.2  # it sinks, and does not drop: 0.3 m of free fall end at 2.4 m/s
    playing.press('2')
    playing.run(2.5)
    assert playing.state == 'fixed stand'


@pytest.mark.broken_legs
@pytest.mark.slow
def test_a_walker_whose_next_step_is_due_at_no_number_ends_in_damping_and_a_line(
    playing, monkeypatch
):
    monkeypatch.setattr(type(player(playing)), 'due_after', np.nan)
    playing.run(0.05)
    assert playing.state == 'passive'
    said = 'policy: due_after: got nan, wanted a number of seconds'
    assert said in playing._robot.legs.notice.text
    playing.press('2')
    playing.run(2.5)
    assert playing.state == 'fixed stand'


@pytest.mark.slow
def test_commands_reach_the_network_by_ramps_and_end_when_nobody_repeats_them(playing):
    dog, shown = playing, []
    walker = player(dog)
    say(dog, np.zeros(12))
    network = walker.policy.network
    walker.policy = walker.policy._replace(
        network=lambda seen: shown.append(seen[6:9] / (2.0, 2.0, 0.25)) or network(seen)
    )
    dog.drive(0.5, 0.1, -0.2)
    dog.run(1.5)
    assert np.abs(np.diff([one[0] for one in shown])).max() < 0.1
    np.testing.assert_allclose(shown[-1], (0.5, 0.1, -0.2), atol=1e-6)
    dog._velocity = None  # who drives falls silent
    dog.run(1.5)
    np.testing.assert_allclose(shown[-1], 0.0, atol=1e-6)
    for _ in range(10):
        dog.press('w')
    dog.run(1.0)
    assert shown[-1][0] > 0.3
    dog.press(' ')
    dog.run(1.5)
    np.testing.assert_allclose(shown[-1], 0.0, atol=1e-6)


@pytest.mark.slow
def test_a_velocity_that_is_lost_while_it_settles_never_drives(dog):
    dog.press('p')
    dog.run(0.05)
    legs, asked = dog._robot.legs.controller, []
    assert legs.set_velocity(1.0, 0.0, 0.0) is None
    for _ in range(16):
        dog.run(0.1)
        asked.append(legs.command_filter.command)
    np.testing.assert_array_equal(asked, 0.0)


@pytest.mark.slow
def test_a_command_that_is_not_followed_is_told_once_with_its_range(playing, monkeypatch):
    said = []
    ranges = ((-0.5, 1.0), (-0.3, 0.3), (-0.2, 0.2))
    monkeypatch.setattr(player(playing), 'ranges', ranges)
    monkeypatch.setattr(playing._robot.legs, 'on_said', said.append)
    # As if no other test had driven it yet.
    state = playing._robot.legs.controller._states['policy']
    monkeypatch.setattr(state, '_is_told', [False, False, False])
    playing.drive(0.5)
    playing.run(5.0)
    assert len(said) == 1
    assert said[0].startswith('the policy does not follow ahead +0.50 m/s')
    assert said[0].endswith('trained for -0.5 to 1')
    playing._velocity = None


@pytest.mark.slow
def test_who_is_not_commanded_stands_though_training_never_stood(tmp_path):
    path, told = tmp_path / 'walk.onnx', {'command_ranges': '0.5;1,-0.3;-0.1,0.2;0.2'}
    told |= {'default_joint_pos': ','.join(map(str, HOME)), 'joint_stiffness': '60'}
    path.write_bytes(onnx(*constant(45, np.zeros(12)), mjlab(MOTORS, **told)))
    dog = wasd.Go2(seed=1, policy=path)
    dog.press('2')
    dog.run(1.3)
    dog.press('p')
    dog.run(SETTLE_TIME + 0.1)
    np.testing.assert_allclose(player(dog).observation[6:9], 0.0, atol=1e-6)


@pytest.mark.slow
def test_a_policy_of_another_robot_is_refused_by_its_joint(tmp_path, standing):
    names = [name.replace('joint', 'motor') for name in MOTORS]
    said = rl_sar(MOTORS, joint_names=names)
    config = write(tmp_path, 'config.yaml', said)
    with pytest.raises(wasd.UserError, match='FR_hip_motor is not in this robot'):
        wasd.Go2(policy=standing[0], policy_config=config)


@pytest.mark.slow
def test_a_default_pose_that_the_robot_cannot_take_is_refused_by_its_joint(tmp_path, standing):
    config = write(tmp_path, 'config.yaml', rl_sar(MOTORS, default_dof_pos=[0.0, 45.0, -90.0] * 4))
    with pytest.raises(wasd.UserError, match=f'{config}: default pose: FR_thigh_joint: got 45'):
        wasd.Go2(policy=standing[0], policy_config=config)


@pytest.mark.slow
def test_any_joint_order_stands_alike(tmp_path, standing):
    heights = []
    for name, order in (('a', MOTORS), ('b', tuple(reversed(MOTORS)))):
        home = dict(zip(MOTORS, np.round(np.array(HOME) + 0.02 * np.arange(12), 3), strict=True))
        said = rl_sar(
            order,
            default_dof_pos=[float(home[joint]) for joint in order],
            rl_kp=[60.0] * 12,
            rl_kd=[3.0] * 12,
        )
        config = write(tmp_path / name, 'config.yaml', said)
        dog = wasd.Go2(seed=1, policy=standing[0], policy_config=config)
        dog.press('2')
        dog.run(1.3)
        dog.press('p')
        dog.run(1.0)
        heights.append(dog._robot.world.joints().position)
    np.testing.assert_array_equal(*heights)
    assert dataclasses.is_dataclass(player(dog).spec)


@pytest.mark.slow
def test_between_steps_of_the_network_motors_hold_and_one_looks_every_10_ms(playing, monkeypatch):
    dog, applied, seen, runs = playing, [], [], []
    controller, world = dog._robot.legs.controller, dog._robot.world
    step, apply, go_on = controller.step, world.apply, world.physics.step
    monkeypatch.setattr(
        controller,
        'step',
        lambda reading, dt, truth: seen.append((dog.time, dt)) or step(reading, dt, truth),
    )
    monkeypatch.setattr(world, 'apply', lambda command: applied.append(command) or apply(command))
    monkeypatch.setattr(world.physics, 'step', lambda count: runs.append(count) or go_on(count))
    dog.drive(0.3, 0.0, 0.0)
    dog.run(0.2)
    dog._velocity = None
    assert len(runs) < 30  # physics stops for who looks, and for its sensors: 100 times else
    times, steps = (np.array(part) for part in zip(*seen, strict=True))
    np.testing.assert_allclose(np.diff(times), steps[1:], atol=1e-9)
    assert steps.max() < 0.01 + 1e-9
    assert len(seen) < 25  # of 100 instants of control
    assert len(applied) == len(seen)
    seen.clear()
    dog.press('2')
    dog.run(0.1)
    np.testing.assert_allclose([dt for _, dt in seen[1:]], 0.002, atol=1e-9)
    assert dog.state == 'fixed stand'


@pytest.mark.slow
def test_a_network_sees_the_joints_as_late_as_was_drawn(standing, monkeypatch):
    drawn = Drawn(sensor_delay=0.003)  # two ticks of the controller
    monkeypatch.setattr(
        worlds, 'randomise', lambda setup, *_: dataclasses.replace(setup, drawn=drawn)
    )
    dog = wasd.Go2(policy=standing[0], policy_config=standing[1], estimator='truth')
    world, true, seen = dog._robot.world, {}, {}
    step = dog._robot.legs.controller.step

    def noted(reading, dt, truth):
        seen[world.tick] = reading.joints.position
        return step(reading, dt, truth)

    dog.press('2')
    dog.run(2.5)
    dog.press('p')
    dog.run(SETTLE_TIME + 0.1)
    dog.drive(0.3, 0.0, 0.0)
    say(dog, np.linspace(-1.0, 1.0, 12))
    monkeypatch.setattr(dog._robot.legs.controller, 'step', noted)
    schedule = dog._simulation.schedule
    schedule.every(0.002, lambda: true.update({world.tick: world.joints().position}))
    dog.run(0.2)
    late = [tick for tick in seen if tick - 4 in true]
    assert len(late) > 15
    order = [
        dog._robot.description.quadruped.joint_names.index(name) for name in world.joint_names
    ]
    for tick in late:
        np.testing.assert_array_equal(seen[tick][order], true[tick - 4])


@pytest.mark.slow
def test_an_e_stop_between_two_looks_makes_the_motors_limp_in_the_next_instant(playing):
    for _ in range(5):  # at each place between two looks
        playing.run(0.002)
        controller = playing._robot.legs.controller
        if playing._robot.rest() > 0.001:
            break
    playing._robot.e_stop('page')
    assert playing._robot.rest() <= 0.0
    playing.run(0.002)
    assert not controller._command.kp.any()
    playing._robot.end_e_stop()


@pytest.mark.slow
def test_an_e_stop_and_a_fall_let_go_as_ever(playing):
    playing._robot.e_stop('page')
    assert playing.state == 'passive'
    playing._robot.end_e_stop()
    playing.run(0.5)
    playing.press('2')
    playing.run(2.5)
    playing.press('p')
    playing.run(SETTLE_TIME + 0.5)
    say(playing, np.where(np.arange(12) // 3 % 2, 2.5, -3.0) * (np.arange(12) % 3 == 0) * 8)
    playing.push((0.0, 900.0, 0.0), 0.2)
    playing.run(2.0)
    assert playing.state == 'passive'
    assert playing._robot.legs.controller.is_fallen
    playing.reset()


@pytest.mark.slow
def test_no_step_is_long_where_physics_may_stop_within_it(dog):
    # With something due at odd milliseconds, a run in pace with wall time stops there, too.
    dog._simulation.schedule.every(0.001, lambda: None, rest=lambda: 1.0)
    dog.press('p')
    dog.run(SETTLE_TIME + 0.1)
    assert share_of_long_steps(dog, 0.3) == 0.0
