# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from quadruped_sim.keys import Sticks, StickValues


@for_all(
    ('key', 'wanted'),
    [
        ('w', StickValues(ly=0.05)),
        ('s', StickValues(ly=-0.05)),
        ('d', StickValues(lx=0.05)),
        ('a', StickValues(lx=-0.05)),
        ('l', StickValues(rx=0.05)),
        ('j', StickValues(rx=-0.05)),
        ('i', StickValues(ry=0.05)),
        ('k', StickValues(ry=-0.05)),
    ],
)
def test_one_press_is_one_step_in_either_case(key, wanted):
    for pressed in (key, key.upper()):
        sticks = Sticks()
        assert sticks.press(pressed)
        assert sticks.values == wanted


def test_steps_add_up_are_latched_and_stop_at_one():
    sticks = Sticks()
    for _ in range(30):
        sticks.press('w')
    assert sticks.values == StickValues(ly=1.0)
    for _ in range(20):
        sticks.press('s')
    assert sticks.values == StickValues()


def test_space_zeroes_all_axes():
    sticks = Sticks()
    for key in 'wdli':
        sticks.press(key)
    assert sticks.press(' ')
    assert sticks.values == StickValues()


def test_other_keys_are_not_taken():
    assert not Sticks().press('q')
    assert not Sticks().press('UP')
