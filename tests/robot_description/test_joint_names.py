# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from robot_description.morphology.names import guess_name, sides, unknown_joint_warning

WHEELS = ('left_wheel_joint', 'right_wheel_joint', 'front_caster_joint')
LEGS = tuple(f'{leg}_{part}_joint' for leg in ('FL', 'FR', 'RL', 'RR') for part in ('hip', 'calf'))


@for_all(
    ('name', 'known', 'wanted'),
    [
        ('base_l_wheel_joint', WHEELS, 'left_wheel_joint'),
        ('base_r_wheel_joint', WHEELS, 'right_wheel_joint'),
        ('wheel_left_joint', WHEELS, 'left_wheel_joint'),
        ('leftWheelJoint', WHEELS, 'left_wheel_joint'),
        ('left_wheel', WHEELS, 'left_wheel_joint'),
        ('left_whel_joint', WHEELS, 'left_wheel_joint'),
        ('FL_calf', LEGS, 'FL_calf_joint'),
        ('front_left_calf_joint', LEGS, 'FL_calf_joint'),
        ('Fl_hip_joint', LEGS, 'FL_hip_joint'),
        ('arm_joint', WHEELS, None),
        ('wheel_joint', WHEELS, None),
        ('left_wheel_joint', ('right_wheel_joint',), None),
        ('left_wheel', (), None),
        ('', WHEELS, None),
    ],
)
def test_the_joint_that_was_meant(name, known, wanted):
    assert guess_name(name, known) == wanted


@for_all(
    ('name', 'wanted'),
    [
        ('left_wheel_joint', {'left'}),
        ('base_r_wheel_joint', {'right'}),
        ('RL_thigh_joint', {'back', 'left'}),
        ('l_ankle_roll', set()),
        ('wheel', set()),
    ],
)
def test_the_sides_of_a_name(name, wanted):
    assert sides(name) == wanted


def test_without_a_likely_name_the_known_ones_are_listed():
    assert unknown_joint_warning('arm_joint', WHEELS).endswith(f'it has {", ".join(WHEELS)}')
