# SPDX-License-Identifier: Apache-2.0
"""True heights by rays from above."""

import mujoco
from mujoco_sim.scene import AHEAD, TREAD
from mujoco_sim.sensors.heights import true_heights
from mujoco_sim.world import build_world
import numpy as np
from robot_description.description import load_robot


def test_the_world_s_heights_are_found_through_the_robot_that_stands_on_it():
    world = build_world(load_robot('go2'), 'stairs:0.12')
    mujoco.mj_forward(world.model, world.data)
    x, y = np.meshgrid(np.arange(-0.5, 2.0, 0.07), np.arange(-0.3, 0.3, 0.05))
    steps = np.clip(np.floor((x - AHEAD) / TREAD) + 1, 0, 6)
    found = true_heights(world, x, y)
    assert found.shape == x.shape
    assert np.allclose(found, 0.12 * steps, atol=1e-6)
