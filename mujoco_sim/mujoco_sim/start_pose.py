# SPDX-License-Identifier: Apache-2.0
"""Where a robot begins: its joints, its height, and out of the floor."""

import math

import mujoco
import numpy as np

from mujoco_sim.robot_parts import RobotParts
from mujoco_sim.robot_setup import RobotSetup


def put_at_start(
    model: mujoco.MjModel, data: mujoco.MjData, parts: RobotParts, setup: RobotSetup
) -> None:
    """Put a robot where its setup says; a floating one relative to where it is now in x and y."""
    for name, position in setup.joint_positions.items():
        data.joint(parts.prefix + name).qpos[0] = position
    if parts.pose is None:
        return
    place = data.qpos[parts.pose][:3]
    place[:2] += setup.place
    place[2] = setup.height
    if setup.sink < math.inf:
        place[2] += max(0.0, -setup.sink - lowest_point(model, data, parts.root))


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> float:
    """
    Return the height of the lowest point of what collides on a robot [m]; inf if nothing does.

    `root` is its first body, `data` holds its pose. Boxes around shapes stand for the shapes,
    so that it may be a little lower than they are; spheres are taken as they are.
    """
    mujoco.mj_kinematics(model, data)
    geoms = np.flatnonzero(
        (model.body_rootid[model.geom_bodyid] == root)
        & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    )
    up = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
    centre, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    reach = (np.abs(up) * half).sum(axis=1) - (up * centre).sum(axis=1)
    is_round = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE
    reach = np.where(is_round, model.geom_rbound[geoms], reach)
    return float((data.geom_xpos[geoms, 2] - reach).min(initial=math.inf))
