# SPDX-License-Identifier: Apache-2.0
"""Where one robot's joints, motors and geoms are in a compiled model that others may share."""

import mujoco
import numpy as np


class RobotParts:
    """
    Names without, and numbers with the robot's prefix in the model.

    `joint_names` and `motor_names` give the order of all else: `position` and `velocity` (n,) are
    the joints' addresses in qpos and qvel, `motors` is the slice of the actuators, `motor_joint`
    (m,) tells the joint of each motor. `pose` and `twist` are the slices of the root's free joint,
    None where it is held in place; `prefix` is what the names have in the model.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str, root: str) -> None:
        self._model = model
        self.prefix = prefix
        self.root = int(model.body(prefix + root).id)
        self.pose: slice | None = None
        self.twist: slice | None = None
        free = mujoco.mjtJoint.mjJNT_FREE
        joints = [model.joint(i) for i in range(model.njnt)]
        for joint in joints:
            if joint.bodyid[0] == self.root and joint.type[0] == free:
                at, moving = int(joint.qposadr[0]), int(joint.dofadr[0])
                self.pose, self.twist = slice(at, at + 7), slice(moving, moving + 6)
        own = [
            joint for joint in joints if joint.type[0] != free and joint.name.startswith(prefix)
        ]
        self.joint_names = tuple(self._own_name(joint.name) for joint in own)
        self.position = np.array([joint.qposadr[0] for joint in own], dtype=int)
        self.velocity = np.array([joint.dofadr[0] for joint in own], dtype=int)
        self.motors = self._find_motors()
        names = [model.actuator(i).name for i in range(model.nu)]
        self.motor_names = tuple(map(self._own_name, names[self.motors]))
        self.motor_joint = np.array(
            [self.joint_names.index(name) for name in self.motor_names], dtype=int
        )
        self.link_of_geom = [
            self._own_name(model.geom(i).name).partition('/')[0] for i in range(model.ngeom)
        ]

    def body(self, link: str) -> int:
        """Return the number of the body that is a link; -1 where it is welded into another."""
        kind = mujoco.mjtObj.mjOBJ_BODY
        return int(mujoco.mj_name2id(self._model, kind, self.prefix + link))

    def _find_motors(self) -> slice:
        names = [self._model.actuator(i).name for i in range(self._model.nu)]
        own = [index for index, name in enumerate(names) if name.startswith(self.prefix)]
        # Those of one robot follow each other, as its specification was attached in one piece.
        return slice(own[0], own[-1] + 1) if own else slice(0, 0)

    def _own_name(self, name: str) -> str:
        """Return a name of the model without the prefix; '' where it is another robot's."""
        return name.removeprefix(self.prefix) if name.startswith(self.prefix) else ''
