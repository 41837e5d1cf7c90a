# SPDX-License-Identifier: Apache-2.0
"""Joints by PD: limp, in a pose, as a policy says; what lets go, and what is said."""

from dataclasses import replace

from cases import for_all
import numpy as np
from policy_player.joint_controller import (
    FALL_TILT,
    JointController,
    RAMPS,
    SETTLE_TIME,
    State,
    TIMEOUT,
)
from policy_player.player import Player
from policy_player.policy_file import Policy
from policy_player.spec import PolicyError, PolicySpec, Term
from policy_player.stands import G1_JOINTS, g1_stand
import pytest
from wasd_core.robot_io import ImuReading, JointStates, Reading

DT = 0.002
LEVEL = np.array((1.0, 0.0, 0.0, 0.0))


class Network:
    """Says what it is told to."""

    def __init__(self, takes, gives):
        self.takes, self.gives, self.action, self.shown = takes, gives, np.zeros(gives), None

    def __call__(self, shown):
        self.shown = shown
        return self.action


def spec_of(joints, **changes):
    count = len(joints)
    values = {
        'source': 'here',
        'joints': tuple(joints),
        'stiffness': tuple(40.0 + i for i in range(count)),
        'damping': (2.0,) * count,
        'default_position': tuple(0.01 * i for i in range(count)),
        'action_scale': (0.25,) * count,
        'action_offset': tuple(0.01 * i for i in range(count)),
        'terms': (Term(name='command'), Term(name='joint_position')),
        'ranges': ((-0.5, 1.0), (-0.3, 0.3), (-0.2, 0.2)),
    }
    return PolicySpec(**{**values, **changes})


def player_of(joints, **changes):
    spec = spec_of(joints, **changes)
    return Player(Policy(spec, Network(spec.width, len(joints))))


def reading(position=None, orientation=LEVEL):
    zeros = np.zeros(len(G1_JOINTS))
    joints = JointStates(zeros if position is None else position, zeros, zeros)
    return Reading(joints, ImuReading(np.array(orientation), np.zeros(3), np.zeros(3)))


def tilted(angle):
    return reading(orientation=(np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0))


def run(controller, seconds, seen=None):
    for _ in range(round(seconds / DT)):
        command = controller.step(seen or reading(), DT)
    return command


@pytest.fixture
def order():
    """The joints of a policy in an order of its own."""
    return tuple(np.random.default_rng(3).permutation(G1_JOINTS).tolist())


@pytest.fixture
def walking(order):
    """A controller whose policy walks."""
    controller = JointController(G1_JOINTS, g1_stand(G1_JOINTS), player_of(order))
    run(controller, 0.1)
    assert controller.press('2') == ''
    run(controller, SETTLE_TIME)
    assert controller.press('p') == ''
    run(controller, 0.1)
    return controller


def test_it_begins_with_damping_alone():
    command = run(JointController(G1_JOINTS, g1_stand(G1_JOINTS)), 0.1)
    assert not command.kp.any()
    assert (command.kd > 0.0).all()


@for_all('waits', [0.0, 0.1])
def test_the_stand_goes_from_where_joints_are_to_its_pose_without_a_jump(waits):
    controller = JointController(G1_JOINTS, g1_stand(G1_JOINTS))
    begin = np.linspace(-0.5, 0.5, len(G1_JOINTS))
    for _ in range(round(waits / DT)):
        controller.step(reading(begin), DT)
    controller.press('2')
    last = begin
    for _ in range(round(SETTLE_TIME / DT) + 1):
        now = controller.step(reading(begin), DT).position
        assert np.abs(now - last).max() < 2.0 * 1.5 * DT / SETTLE_TIME
        last = now
    np.testing.assert_allclose(last, g1_stand(G1_JOINTS).position)


def test_a_policy_of_29_joints_commands_each_by_its_name(walking, order):
    walking._player.policy.network.action = np.arange(29.0)
    command = run(walking, 0.05)
    for at, name in enumerate(order):
        motor = G1_JOINTS.index(name)
        assert command.position[motor] == pytest.approx(0.01 * at + 0.25 * at)
        assert (command.kp[motor], command.kd[motor]) == (40.0 + at, 2.0)


def test_joints_that_a_policy_of_legs_has_not_stay_in_the_stand():
    controller = JointController(G1_JOINTS, g1_stand(G1_JOINTS), player_of(G1_JOINTS[:12]))
    run(controller, 0.1)
    controller.press('2')
    run(controller, SETTLE_TIME)
    controller.press('p')
    controller._player.policy.network.action = np.full(12, 2.0)
    command, stand = run(controller, 0.1), g1_stand(G1_JOINTS)
    np.testing.assert_allclose(command.position[12:], stand.position[12:])
    np.testing.assert_allclose(command.kp[12:], stand.stiffness[12:])
    np.testing.assert_allclose(command.position[:12], 0.01 * np.arange(12) + 0.5)


def test_a_velocity_ramps_within_the_ranges_of_training_and_is_forgotten(walking):
    assert walking.command((5.0, 0.0, 0.0)) == ''
    run(walking, 0.25)
    assert walking.velocity[0] == pytest.approx(0.25 * RAMPS[0], rel=0.02)
    for _ in range(20):
        walking.command((5.0, 5.0, -5.0))
        run(walking, 0.2)
    np.testing.assert_allclose(walking.velocity, (1.0, 0.3, -0.2))
    run(walking, 0.05)
    np.testing.assert_allclose(walking._player.policy.network.shown[:3], (1.0, 0.3, -0.2))
    run(walking, TIMEOUT + 1.0 / RAMPS[0] + 0.1)
    assert not walking.velocity.any()


def test_who_is_not_commanded_stands_though_training_never_stood(order):
    player = player_of(order, ranges=((0.5, 1.0), (-0.3, -0.1), (0.2, 0.2)))
    controller = JointController(G1_JOINTS, g1_stand(G1_JOINTS), player)
    run(controller, 0.1)
    controller.press('2')
    run(controller, SETTLE_TIME)
    controller.press('p')
    controller.command((5.0, -5.0, 5.0))
    run(controller, 0.2)
    assert controller.velocity.all()
    controller.command((0.0, 0.0, 0.0))
    run(controller, 1.0)
    assert not controller.velocity.any()


@pytest.mark.parametrize('bad', [np.nan, np.inf])
def test_what_is_no_number_never_reaches_a_motor(walking, bad):
    assert 'no number' in walking.command((bad, 0.0, 0.0))
    position = np.zeros(29)
    position[3] = bad
    command = walking.step(reading(position), DT)
    assert np.isfinite(command).all()
    assert walking.state is State.PASSIVE
    assert 'readings' in walking.take_remark()


@pytest.mark.parametrize('action', [np.full(29, np.nan), np.zeros(3)])
def test_a_network_that_says_no_number_ends_in_damping_and_a_line(walking, action):
    walking._player.policy.network.action = action
    command = run(walking, 0.05)
    assert walking.state is State.PASSIVE
    assert not command.kp.any()
    assert walking.take_remark().startswith('the output of the network is not a number')
    assert walking.take_remark() == ''


def test_one_that_is_hindered_stands_and_no_key_walks_on(walking):
    walking.hindrance = 'joint_states comes at 10 Hz'
    command = run(walking, SETTLE_TIME)
    assert walking.state is State.STAND
    np.testing.assert_allclose(command.position, walking._stand.position)
    assert walking.press('p') == walking.hindrance
    walking.hindrance = ''
    assert walking.press('p') == ''


def test_beyond_the_tilt_it_damps_and_says_so_once(walking):
    run(walking, 0.1, tilted(FALL_TILT - 0.02))
    assert walking.state is State.POLICY
    command = run(walking, 0.1, tilted(FALL_TILT + 0.02))
    assert (walking.state, walking.is_fallen) == (State.PASSIVE, True)
    assert not command.kp.any()
    assert walking.take_remark().startswith(
        'fallen: /simulator/hoist raises it, /simulator/reset puts it back'
    )
    run(walking, 0.1, tilted(1.5))
    assert walking.take_remark() == ''
    assert walking.press('2') == (
        'raise it by /simulator/hoist, or put it back by /simulator/reset (it has fallen)'
    )
    run(walking, 0.1)
    assert walking.press('2') == ''


def test_keys_say_what_to_press():
    controller = JointController(G1_JOINTS, g1_stand(G1_JOINTS))
    assert controller.press('p').startswith('give -p policy:=FILE')
    assert controller.command((0.3, 0.0, 0.0)).startswith('give -p policy:=FILE')
    other = JointController(G1_JOINTS, g1_stand(G1_JOINTS), player_of(G1_JOINTS))
    assert other.press('p') == 'press 2 to stand, then p'
    assert other.command((0.3, 0.0, 0.0)) == 'press 2, then p to walk (it is passive)'
    assert other.command((0.0, 0.0, 0.0)) == ''
    other.press('2')
    run(other, 0.5)
    assert 'in a second' in other.press('p')
    assert other.press('2') == 'it is in stand already'


@for_all(
    ('joints', 'changes', 'words'),
    [
        (('FL_hip_joint', 'FL_thigh_joint'), {}, 'FL_hip_joint is not in this robot'),
        (G1_JOINTS, {'terms': (Term(name='linear_velocity'),)}, 'linear_velocity'),
        (G1_JOINTS, {'terms': (Term(name='height_scan_by_row'),)}, 'height_scan_by_row'),
    ],
)
def test_a_policy_of_another_robot_is_refused_by_a_name(joints, changes, words):
    with pytest.raises(PolicyError, match=words):
        JointController(G1_JOINTS, g1_stand(G1_JOINTS), player_of(joints, **changes))


def test_ranges_of_training_bound_what_a_full_stick_is(order):
    spec = replace(spec_of(order), ranges=None)
    player = Player(Policy(spec, Network(spec.width, 29)))
    assert JointController(G1_JOINTS, g1_stand(G1_JOINTS), player).full == (1.0, 0.3, 0.5)
