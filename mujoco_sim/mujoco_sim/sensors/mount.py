# SPDX-License-Identifier: Apache-2.0
"""Where a sensor is mounted, the site it sits on, and what it looks at."""

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from robot_description.robot import Robot
from wasd_core.rotations import Pose

from mujoco_sim.world import World

# What noise is drawn with; None where sensors tell the truth.
Random = np.random.Generator | None
# What a message says, by the names of its fields; the header is the publisher's affair.
Fields = dict[str, Any]


class Mount(NamedTuple):
    """A frame that is fixed in a body: the body's number and the frame's pose in it."""

    body: int
    pose: Pose

    def in_world(self, data: mujoco.MjData) -> Pose:
        """Return the frame's pose in the world, by the bodies' poses in `data`."""
        rotation = data.xmat[self.body].reshape(3, 3)
        return Pose(data.xpos[self.body].copy(), rotation) @ self.pose

    def in_base(self, world: World) -> Pose:
        """Return the frame's pose in the base of the world's robot, by its joints as they are."""
        if self.body == world.root:
            return self.pose
        own, place = self.in_world(world.data), world.data.xpos[world.root]
        back = world.data.xmat[world.root].reshape(3, 3).T
        return Pose(back @ (own.position - place), back @ own.rotation)


class Snapshot:
    """
    Poses and velocities of one instant, computed aside: what physics works on is left as it is.

    `take` is free when asked again in the same instant.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._state: tuple[bytes, ...] | None = None
        self._data: mujoco.MjData | None = None
        self._is_whole = False

    def take_whole(self) -> mujoco.MjData:
        """Return data with bodies, geoms and lights as they are and move now."""
        model, data = self._world.model, self.take()
        if not self._is_whole:
            self._is_whole = True
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_camlight(model, data)
        return data

    def take(self) -> mujoco.MjData:
        """Return data with bodies and geoms as they are now: all that rays need."""
        model, now = self._world.model, self._world.data
        if self._data is None:
            self._data = mujoco.MjData(model)
        parts = (now.qpos, now.qvel, now.mocap_pos, now.mocap_quat)
        state = tuple(part.tobytes() for part in parts)
        if state != self._state:
            self._state, self._is_whole = state, False
            self._data.qpos[:], self._data.qvel[:] = now.qpos, now.qvel
            self._data.mocap_pos[:], self._data.mocap_quat[:] = now.mocap_pos, now.mocap_quat
            mujoco.mj_kinematics(model, self._data)
        return self._data


class Site:
    """
    What the sensors of one robot share: its world, one snapshot an instant, one renderer.

    `scale` makes all pictures smaller, also while it runs. `say` hears what cannot be measured.
    """

    def __init__(
        self,
        world: World,
        robot: Robot,
        scale: float = 1.0,
        say: Callable[[str], Any] = lambda text: None,
    ) -> None:
        self.world = world
        self.snapshot = Snapshot(world)
        self.scale = scale
        self.say = say
        self.renderer: Any = None  # a SharedRenderer, where there is a camera
        self._robot = robot

    def find_mount(self, link: str, pose: Pose) -> Mount:
        """Return where a frame with this pose in a link is in the compiled model."""
        while True:
            body = self.world.parts.body(link)
            if body >= 0:
                return Mount(body, pose)
            joint = self._robot.parent_joints[link]
            pose, link = joint.pose @ pose, joint.parent

    def close(self) -> None:
        """Release the renderer, if there is one."""
        if self.renderer is not None:
            self.renderer.close()
