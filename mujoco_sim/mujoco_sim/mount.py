# SPDX-License-Identifier: Apache-2.0
"""Where a sensor is: its link may be welded into the body that MuJoCo knows."""

from typing import NamedTuple

import mujoco
from robot_description.pose import Pose
from robot_description.urdf import Robot

from mujoco_sim.world import World


class Mount(NamedTuple):
    """A frame that is fixed in a body: the body's number and the frame's pose in it."""

    body: int
    pose: Pose

    def in_world(self, data: mujoco.MjData) -> Pose:
        """Return the frame's pose in the world, by the bodies' poses in `data`."""
        rotation = data.xmat[self.body].reshape(3, 3)
        return Pose(data.xpos[self.body].copy(), rotation) @ self.pose


def find_mount(world: World, robot: Robot, link: str, pose: Pose) -> Mount:
    """Return where a frame with this pose in a link is in the compiled model."""
    joints = {joint.child: joint for joint in robot.joints.values()}
    while True:
        body = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_BODY, link)
        if body >= 0:
            return Mount(body, pose)
        pose = joints[link].pose @ pose
        link = joints[link].parent


class Snapshot:
    """
    The bodies' poses of one instant, computed aside: what physics works on is left as it is.

    `take` is free when asked again in the same instant.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._tick: tuple[int, bytes] | None = None
        self.data = mujoco.MjData(world.model)

    def take(self) -> mujoco.MjData:
        """Return data with the poses of bodies, geoms and lights of now."""
        model, now = self._world.model, self._world.data
        key = (self._world.tick, now.qpos.tobytes())
        if key != self._tick:
            self._tick = key
            self.data.qpos[:] = now.qpos
            self.data.mocap_pos[:] = now.mocap_pos
            self.data.mocap_quat[:] = now.mocap_quat
            mujoco.mj_kinematics(model, self.data)
            mujoco.mj_comPos(model, self.data)
            mujoco.mj_camlight(model, self.data)
        return self.data
