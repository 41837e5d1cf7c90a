# SPDX-License-Identifier: Apache-2.0
"""What of the floor a robot covers, by what of it collides."""

import math

import mujoco
import numpy as np

from mujoco_sim.world import World

# Points on a rim, and where its ends are along z.
_RIM = np.array(
    [
        (math.cos(angle), math.sin(angle), end)
        for angle in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        for end in (-1.0, 1.0)
    ]
)
_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_CYLINDER, _MESH = int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_MESH)


def outline_of(world: World, is_whole: bool = True) -> np.ndarray:
    """
    Return points around what collides of a robot, as seen from above, shape (n, 2) [m].

    They are in the frame of its base, as it is now; of its base alone unless `is_whole`.
    """
    model, data, root = world.model, world.data, world.root
    own = model.geom_bodyid == root
    if is_whole:
        own = model.body_rootid[model.geom_bodyid] == model.body_rootid[root]
    rotation = data.xmat[root].reshape(3, 3)
    parts = []
    for geom in np.flatnonzero(own & (model.geom_contype != 0)):
        corners = _surface(model, int(geom))
        placed = data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T
        parts.append((placed - data.xpos[root]) @ rotation)
    return np.asarray(np.concatenate(parts)[:, :2])


def _surface(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return points around a geom, in its axes, (n, 3)."""
    size = model.geom_size[geom]
    if model.geom_type[geom] == _CYLINDER:
        return np.asarray(_RIM * (size[0], size[0], size[1]))
    if model.geom_type[geom] == _MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]])
    return np.asarray(model.geom_aabb[geom, :3] + _CORNERS * model.geom_aabb[geom, 3:])
