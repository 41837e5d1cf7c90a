# SPDX-License-Identifier: Apache-2.0
"""True heights of the ground, by rays from above through the robot that stands on it."""

import mujoco
import numpy as np

from mujoco_sim.sensors.lidar import SEEN_GROUPS
from mujoco_sim.world import World

# A ray begins so far above the base, and goes on so far below what of the robot it has hit [m].
ABOVE, BELOW = 1.0, 1e-4


def true_heights(world: World, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the world's heights at places of one shape [m]; NaN where nothing is below."""
    model, data = world.model, world.data
    own = model.body_rootid[world.root]
    begin = float(world.base().position[2]) + ABOVE
    hit = np.empty(1, dtype=np.int32)
    found = np.full(np.shape(x), np.nan)
    down = np.array((0.0, 0.0, -1.0))
    for place in np.ndindex(found.shape):
        start = np.array((np.asarray(x)[place], np.asarray(y)[place], begin))
        while True:
            way = mujoco.mj_ray(model, data, start, down, SEEN_GROUPS, True, -1, hit)
            if way < 0.0:
                break
            start[2] -= way
            if model.body_rootid[model.geom_bodyid[hit[0]]] != own:
                found[place] = start[2]
                break
            start[2] -= BELOW
    return found
