# SPDX-License-Identifier: Apache-2.0
"""Mistakes that walk on without a word are found by their numbers."""

from dataclasses import replace

from cases import for_all
from policy_files import MOTORS
from policy_player.formats import legged_gym
from policy_player.spec import PolicySpec, Term
from policy_player.usual import beyond_limits, oddities, order_of, orders, variants
from robot_description.description import load_robot

POSE = (0.0, 0.8, -1.5) * 4
# As rl_sar's Go2 of robot_lab.
SPEC = PolicySpec(
    source='config.yaml',
    joints=MOTORS,
    stiffness=(20.0,) * 12,
    damping=(0.5,) * 12,
    default_position=POSE,
    action_scale=(0.125, 0.25, 0.25) * 4,
    action_offset=POSE,
    terms=(
        Term(name='angular_velocity', scale=(0.25,)),
        Term(name='gravity'),
        Term(name='command'),
        Term(name='joint_position'),
        Term(name='joint_velocity', scale=(0.05,)),
        Term(name='last_action'),
    ),
)


def with_scale(name: str, scale: float) -> PolicySpec:
    terms = [replace(t, scale=(scale,)) if t.name == name else t for t in SPEC.terms]
    return replace(SPEC, terms=tuple(terms))


SILENT = {
    'gains of the stand': (replace(SPEC, stiffness=(80.0,) * 12, damping=(3.0,) * 12), 'stand'),
    'kp halved': (replace(SPEC, stiffness=(10.0,) * 12), 'half of it?'),
    'kd 0': (replace(SPEC, damping=(0.0,) * 12), 'damping 0'),
    'action scale doubled, of 0.3': (replace(SPEC, action_scale=(0.6,) * 12), 'doubled'),
    'joint velocity left out': (with_scale('joint_velocity', 0.0), 'joint_velocity is always'),
    '100 Hz for 50': (replace(SPEC, period=0.01), '100 Hz'),
    'last action scaled': (with_scale('last_action', 0.25), 'last_action has a scale'),
    'last action missing': (with_scale('last_action', 0.0), 'last_action is always zero'),
    'another pose': (replace(SPEC, action_offset=(0.0, 0.67, -1.3) * 4), 'default position'),
}


def test_nothing_is_odd_about_a_public_policy():
    assert oddities(SPEC) == []


def test_a_default_pose_in_degrees_is_told_and_one_at_its_stops_is_not():
    robot = load_robot('go2').robot
    knee = robot.joints['FL_calf_joint']
    folded = (0.0, 0.8, knee.lower - 0.01) * 4
    assert beyond_limits(SPEC, robot) == ''
    assert beyond_limits(replace(SPEC, default_position=folded), robot) == ''
    degrees = replace(SPEC, default_position=(0.0, 45.0, -90.0) * 4)
    words = 'default pose: FR_thigh_joint: got 45 rad, wanted -1.57 to 3.49 (degrees?)'
    assert beyond_limits(degrees, robot) == words
    assert beyond_limits(replace(degrees, joints=tuple('abcdefghijkl')), robot) == ''


@for_all('mistake', SILENT)
def test_a_silent_mistake_is_told(mistake):
    spec, words = SILENT[mistake]
    assert any(words in told for told in oddities(spec))


def test_a_scale_that_is_doubled_within_what_is_usual_is_among_what_is_tried():
    doubled = replace(SPEC, action_scale=(0.25, 0.5, 0.5) * 4)
    assert oddities(doubled) == []
    tried = dict(variants(doubled))
    assert tried['the action scale is twice of what it should be'] == SPEC


def test_an_estimated_velocity_is_warned_of():
    assert any('estimate of the legs' in told for told in oddities(legged_gym()))


def test_orders_that_may_be_meant_are_the_others_of_the_same_joints():
    told = dict(orders(SPEC))
    assert len(told) == 3
    assert told.items() <= dict(variants(SPEC)).items()
    assert all(set(spec.joints) == set(MOTORS) != spec.joints for spec in told.values())
    assert order_of(SPEC) == 'FR FL RR RL, leg by leg'
    assert {order_of(spec) for spec in told.values()} == {
        'FL FR RL RR, leg by leg',
        'FL FR RL RR, by kind',
        'FR FL RR RL, by kind',
    }
