# SPDX-License-Identifier: Apache-2.0
"""A world without physics: the robot is where it is put."""

from collections.abc import Mapping, Sequence
import math
from typing import NamedTuple

import mujoco

from mujoco_sim.world import World


class PlanarPose(NamedTuple):
    """Pose of the root on the floor [m], [rad], and its velocity in its own axes."""

    x: float
    y: float
    yaw: float
    linear: float  # [m/s], forward
    lateral: float  # [m/s], to the left
    angular: float  # [rad/s]


def pose_base(world: World, position: Sequence[float], orientation: Sequence[float]) -> None:
    """Put the root where it was: [m] from the place of its start, quaternion w, x, y, z."""
    if world.parts.pose is not None:
        start = (*world.setup.place, 0.0)
        pose = world.data.qpos[world.parts.pose]
        pose[:3] = [coordinate + begin for coordinate, begin in zip(position, start, strict=True)]
        pose[3:] = orientation


def pose_joints(world: World, names: Sequence[str], positions: Sequence[float]) -> None:
    """Put the joints that the model knows at positions [rad] or [m]."""
    known = dict(zip(world.joint_names, world.parts.position.tolist(), strict=True))
    for name, position in zip(names, positions, strict=True):
        if name in known:
            world.data.qpos[known[name]] = position


def update_bodies(world: World) -> None:
    """Compute where all bodies of the model are with the joints and bases as they were put."""
    mujoco.mj_forward(world.model, world.data)


def place(world: World, pose: PlanarPose, joints: Mapping[str, tuple[float, float]]) -> None:
    """Put the robot at a pose, and joints at a position [rad] and velocity [rad/s]."""
    data = world.data
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    at, motion = data.qpos[world.parts.pose], data.qvel[world.parts.twist]
    at[0:2] = pose.x, pose.y
    at[3:7] = math.cos(0.5 * pose.yaw), 0.0, 0.0, math.sin(0.5 * pose.yaw)
    motion[:] = 0.0
    motion[0] = cos * pose.linear - sin * pose.lateral
    motion[1] = sin * pose.linear + cos * pose.lateral
    motion[5] = pose.angular
    for name, (position, velocity) in joints.items():
        joint = data.joint(world.prefix + name)
        joint.qpos[0], joint.qvel[0] = position, velocity
    mujoco.mj_forward(world.model, data)
