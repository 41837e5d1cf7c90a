# SPDX-License-Identifier: Apache-2.0
"""The preset `ramps` beside the formula of the tutorial that it comes from."""

import math
import random

import pytest
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.parameters import TeleopParameters

pytestmark = pytest.mark.slow


class SeedRamps:
    """keys_to_twist_with_ramps as the tutorial prints it, with its two lost `return`s."""

    KEYS = {'w': [0, 1], 'x': [0, -1], 'a': [1, 0], 'd': [-1, 0], 's': [0, 0]}

    def __init__(self, scales=(0.5, 0.5), ramps=(1.0, 1.0)):
        self.scales, self.ramps = scales, ramps
        self.target, self.last, self.last_time = [0.0, 0.0], [0.0, 0.0], 0.0

    @staticmethod
    def ramped_vel(v_prev, v_target, t_prev, t_now, ramp_rate):
        step = ramp_rate * (t_now - t_prev)
        sign = 1.0 if (v_target > v_prev) else -1.0
        error = math.fabs(v_target - v_prev)
        if error < step:
            return v_target
        else:
            return v_prev + sign * step

    def key(self, text):
        if len(text) == 0 or text[0] not in self.KEYS:
            return
        vels = self.KEYS[text[0]]
        self.target = [vels[0] * self.scales[0], vels[1] * self.scales[1]]

    def send_twist(self, t_now):
        self.last = [
            self.ramped_vel(self.last[axis], self.target[axis], self.last_time, t_now, ramp)
            for axis, ramp in enumerate(self.ramps)
        ]
        self.last_time = t_now
        return self.last


@pytest.mark.parametrize(
    ('scales', 'ramps'), [((0.5, 0.5), (1.0, 1.0)), ((0.7, 0.3), (0.9, 0.35))]
)
def test_ramps_is_the_golden_trace_of_the_tutorial(scales, ramps):
    seed = SeedRamps(scales, ramps)
    parameters = TeleopParameters(
        angular_scale=scales[0],
        linear_scale=scales[1],
        angular_accel=ramps[0],
        linear_accel=ramps[1],
    )
    logic = KeysToTwist(load_preset('ramps'), parameters)
    generator = random.Random(2)
    for index in range(1, 2000):
        if generator.random() < 0.1:
            text = generator.choice(['w', 'x', 'a', 'd', 's', '', 'q', 'UP', 'wasd', 'dx'])
            seed.key(text)
            logic.press(text)
        wz, vx = seed.send_twist(index * 0.05)
        # 1e-9: the tutorial subtracts absolute times, which costs a few digits.
        assert logic.step(0.05) == pytest.approx((vx, 0.0, 0.0, wz), abs=1e-9)
