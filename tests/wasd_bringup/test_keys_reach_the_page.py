# SPDX-License-Identifier: Apache-2.0
"""Every key that means something to a robot or to a run can be pressed on the page."""

from cases import for_all
from mujoco_sim.viewer.input import PAGE_KEYS
from quadruped_sim.keys import STATE_KEYS, STICK_KEYS, ZERO_KEYS
from teleop_keyboard.dashboard import HELP_KEYS
from teleop_keyboard.keymap_file import load_preset, preset_names
from wasd_bringup.run.inputs import RESET_KEY, SWITCH_KEY

NAMES = {name for pair in PAGE_KEYS.values() for name in pair}


@for_all('preset', preset_names())
def test_every_key_of_a_preset_is_on_the_page(preset):
    assert set(load_preset(preset).keys) <= NAMES


def test_every_key_of_a_quadruped_is_on_the_page():
    assert {*STATE_KEYS, *STICK_KEYS, ZERO_KEYS[0]} <= NAMES


def test_every_key_of_a_run_is_on_the_page():
    assert {SWITCH_KEY, RESET_KEY, *HELP_KEYS} <= NAMES
