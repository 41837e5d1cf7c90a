# SPDX-License-Identifier: Apache-2.0
"""Where the links of a robot are."""

from collections.abc import Mapping

from wasd_core.rotations import IDENTITY
from wasd_core.rotations import Pose

from robot_description.urdf import Robot


def link_poses(robot: Robot, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Return the pose of every link in the root, with joints at positions [rad] or [m]."""
    poses = {robot.root: IDENTITY}
    for link in robot.links_from_root[1:]:
        joint = robot.parent_joints[link]
        poses[link] = poses[joint.parent] @ joint.transform(positions.get(joint.name, 0.0))
    return poses
