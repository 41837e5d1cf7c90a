# SPDX-License-Identifier: Apache-2.0
"""A gait that can be chosen follows its full stick, in each direction, and back to rest."""

import numpy as np
import pytest
from quadruped_sim.parameters import GAITS
import wasd

STEPS, COUNT = 0.1, 15
# Ramp and settling before the speed counts [s].
SETTLE = 2.0


@pytest.mark.slow
@pytest.mark.parametrize('gait', GAITS)
def test_it_follows_its_full_stick(gait: str) -> None:
    dog = wasd.Go2(seed=905, gait=gait)
    dog.press('2')
    dog.run(2.5)
    dog.press('5')
    for axis, speed in enumerate(dog.full_stick):
        command = np.zeros(3)
        command[axis] = speed
        dog.drive(*command)
        dog.run(SETTLE)
        seen = []
        for _ in range(COUNT):
            dog.run(STEPS)
            seen.append(dog.truth.planar_velocity[axis])
        assert dog.state == 'move base'
        assert np.mean(seen) == pytest.approx(speed, rel=0.1)
    dog.drive(0.0)
    dog.run(2.5)
    assert np.abs(dog.truth.planar_velocity).max() < 0.02
